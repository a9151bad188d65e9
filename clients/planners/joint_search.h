// SPDX-License-Identifier: Apache-2.0
// A path for a robot whose configuration space has too many joints for a grid: two trees of
// straight motions that grow towards each other from start and goal (RRT-Connect, Kuffner and
// LaValle 2000).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "db/mask/configuration_grid.h"

namespace silhouette {

struct JointSearchSettings {
  // Longest motion that is tried at once, radians or metres of the joint that moves most.
  double step = 0.5;
  // Motions that are checked until the search ends without a path.
  int most_checks = 20'000;
  // Shorter ways that are tried in the end.
  int shortcuts = 150;
  uint64_t seed = 1;
};

struct JointSearch {
  std::vector<Configuration> waypoints;  // from start to goal; empty: none was found
  int checks = 0;                        // calls of `is_free`
};

// `is_free`: whether the straight motion between two configurations is free; an error ends the
// search. `joints`: the limits; a joint is not turned across the end of its range. `stopped` is
// asked before each check; Aborted if it returns true. The same seed and answers give the same
// path.
absl::StatusOr<JointSearch> SearchJoints(
    std::span<const GridJoint> joints, const Configuration& start, const Configuration& goal,
    const JointSearchSettings& settings,
    const std::function<absl::StatusOr<bool>(const Configuration& from, const Configuration& to)>&
        is_free,
    const std::function<bool()>& stopped);

}  // namespace silhouette
