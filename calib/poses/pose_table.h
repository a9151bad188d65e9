// SPDX-License-Identifier: Apache-2.0
// PoseTable: a table of robot poses as robots and people write it, made one of comma-separated
// fields with the names of a PoseNotation.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_notation.h"

namespace silhouette {

struct PoseTable {
  std::string csv;                   // every row is on the line where it was, or began
  std::vector<std::string> columns;  // of its rows; the frame first, unless rows have none
  bool named = false;                // the first line has the columns' names
  bool has_frames = true;
};

// Takes away comments (#, %, //) and brackets; reads decimal commas, and matrices over several
// lines. Of a line of names: x, y, z and qx, q_x, quat_x, ... are the notation's; image, file,
// time, index, ... are the frame. A '-' is YAML's mark of a list if every line begins with one,
// before a bracket or a name. InvalidArgument with `file` and line: another '-' apart from its
// number.
absl::StatusOr<PoseTable> PoseTableOf(const std::string& text, const std::string& file,
                                      const PoseNotation& notation);

// The text with a line of name and numbers for each pose in a controller's own syntax: KUKA's FRAME
// and E6POS, Fanuc's P[1]{...}, RAPID's robtarget, UR's p[...]; the text itself if it has none.
std::string WithoutRobotSyntax(const std::string& text, const PoseNotation& notation);

// Fields that are separated by anything but points; numpy's array(...) around them is taken away.
std::vector<std::string> PoseFields(const std::string& text);

}  // namespace silhouette
