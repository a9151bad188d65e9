// SPDX-License-Identifier: Apache-2.0
// PoseTable: a table of robot poses as robots and people write it, made one of comma-separated
// fields with the names of a PoseNotation.
#pragma once

#include <string>
#include <vector>

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
// time, index, ... are the frame. A '-' without its number is YAML's mark of a list if every line
// begins with one, before a bracket or a name. Otherwise the table has a row whose fields are no
// numbers and name the mend.
PoseTable PoseTableOf(const std::string& text, const PoseNotation& notation);

// Fields that are separated by anything but points. A '-' without its number as in PoseTableOf: its
// field is no number and names the mend.
std::vector<std::string> PoseFields(const std::string& text);

}  // namespace silhouette
