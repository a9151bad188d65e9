// SPDX-License-Identifier: Apache-2.0
// Where the robots of the tests move to, and how long a busy machine may need for it.
#pragma once

#include <functional>
#include <vector>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace silhouette {

inline const std::vector<double> kHere = {0, 0, 0};
inline const std::vector<double> kThere = {0.5, -0.5, 0.1};
// Radians or metres that count as there, for DoubleNear().
inline constexpr double kNearRobot = 0.002;

// Waits until `happened`, at most two minutes: a busy machine may be slow.
inline bool Eventually(const std::function<bool()>& happened) {
  const absl::Time end = absl::Now() + absl::Minutes(2);
  while (!happened() && absl::Now() < end) absl::SleepFor(absl::Milliseconds(5));
  return happened();
}

}  // namespace silhouette
