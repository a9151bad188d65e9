// SPDX-License-Identifier: Apache-2.0
// A picture of a motion: the robot's silhouettes along a path, one over the other, in every view.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {

// Writes a PNG file. `positions`: waypoints, of all joints of the robot. The cell with its
// obstacles and without the robot is behind the silhouettes, which go from the start's colour to
// the goal's.
absl::Status WriteMotion(const Workplace& workplace,
                         const std::vector<std::vector<double>>& positions,
                         const std::string& path);

}  // namespace silhouette
