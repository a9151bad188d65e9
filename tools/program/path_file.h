// SPDX-License-Identifier: Apache-2.0
// Paths in JSON files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace silhouette {

// {"joints": ["joint_1", "joint_3"], "waypoints": [[0.1, 0.2], [0.3, 0.2]]}; further keys do not
// count. `silhouette plan --out` writes it.
struct PathFile {
  std::string file;                 // its name
  std::vector<std::string> joints;  // of the values of each waypoint; empty: the file does not say
  std::vector<std::vector<double>> waypoints;  // at least one; radians, metres
};

// The path in the text of a file of this name. InvalidArgument, naming the file.
absl::StatusOr<PathFile> ParsePath(std::string_view text, const std::string& file);

// InvalidArgument, naming the file, if it says that its values are of other joints than these, or
// in another order.
absl::Status RequireJoints(const PathFile& path, const std::vector<std::string>& joints);

}  // namespace silhouette
