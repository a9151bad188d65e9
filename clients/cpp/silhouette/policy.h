// SPDX-License-Identifier: Apache-2.0
// How verdicts follow from images, and what they include. Unset fields of a policy take the
// server's default.
#pragma once

#include <optional>
#include <string>

namespace silhouette::client {

// What stands for a configuration off the grid.
enum class OffGrid {
  kCell,     // the union of the robot images at the corners of its grid cell
  kNearest,  // the robot image of the nearest grid point
};

struct Policy {
  // One of Database::presets, e.g. "uncalibrated" or "calibrated"; empty: the server's default.
  std::string preset = {};
  // Occupied if at least this many views show an obstacle inside the robot; 1 to number of views.
  std::optional<int> min_views = std::nullopt;
  // With the preset "uncalibrated" and no min_views: in how many views the robot may occlude an
  // obstacle.
  std::optional<int> max_occluded_views = std::nullopt;
  std::optional<OffGrid> off_grid = std::nullopt;
};

// Whether verdicts include the evidence of each view: longer replies.
enum class Evidence { kPerView, kOmit };
// Whether verdicts include clearances, which take time to measure.
enum class Clearance { kOmit, kMeasure };

}  // namespace silhouette::client
