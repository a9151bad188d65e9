// SPDX-License-Identifier: Apache-2.0
// Configurations on the straight line between two others, in joint values as they are: a continuous
// joint takes the way that the values say, over as many turns.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "db/mask/configuration_grid.h"

namespace silhouette {

// Makes `q` the configuration at this fraction of the line; exactly `from` at 0 and `to` at 1. All
// have the same number of values. Never allocates.
inline void Interpolate(std::span<const double> from, std::span<const double> to, double fraction,
                        std::span<double> q) {
  for (size_t j = 0; j < q.size(); ++j) q[j] = std::lerp(from[j], to[j], fraction);
}

// The same as a value.
inline Configuration Interpolated(std::span<const double> from, std::span<const double> to,
                                  double fraction) {
  Configuration q(from.size());
  Interpolate(from, to, fraction, q);
  return q;
}

}  // namespace silhouette
