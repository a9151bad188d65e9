// SPDX-License-Identifier: Apache-2.0
// By how much joint values differ where full turns of continuous joints do not count.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

namespace silhouette {

// The joint that deviates most.
struct JointDeviation {
  size_t joint = 0;
  double deviation = 0;  // radians or metres, at least 0; infinite if a value is not a number
};

// `values`, those of continuous joints moved by full turns to within half a turn of `references`.
// Both have one size. `continuous`: by the place of each joint; joints beyond its end are not
// continuous.
inline std::vector<double> NearestTurns(std::span<const double> values,
                                        std::span<const double> references,
                                        const std::vector<bool>& continuous) {
  constexpr double kTurn = 2 * std::numbers::pi;
  std::vector<double> nearest(values.begin(), values.end());
  for (size_t j = 0; j < nearest.size() && j < continuous.size(); ++j) {
    if (continuous[j]) nearest[j] -= kTurn * std::round((nearest[j] - references[j]) / kTurn);
  }
  return nearest;
}

// As NearestTurns(); full turns of continuous joints do not count.
inline JointDeviation GreatestDeviation(std::span<const double> from, std::span<const double> to,
                                        const std::vector<bool>& continuous = {}) {
  const std::vector<double> nearest = NearestTurns(to, from, continuous);
  JointDeviation greatest;
  for (size_t j = 0; j < from.size(); ++j) {
    const double deviation = std::abs(nearest[j] - from[j]);
    if (!std::isfinite(deviation)) return {.joint = j, .deviation = INFINITY};
    if (deviation > greatest.deviation) greatest = {.joint = j, .deviation = deviation};
  }
  return greatest;
}

}  // namespace silhouette
