// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_places.h"

#include <algorithm>
#include <stdexcept>

namespace silhouette {

void RequireDrawnPlaces(const KinematicChain& chain, const ConfigurationGrid& grid,
                        const JointRegions& forbidden) {
  const auto same = [](const GridJoint& a, const ChainJoint& b) { return a.name == b.name; };
  if (!std::ranges::equal(grid.joints(), chain.joints(), same)) {
    throw std::invalid_argument("the grid's joints are not those that move the drawn robot");
  }
  GridIndex last{};
  for (size_t j = 0; j < chain.joints().size(); ++j) last[j] = grid.joints()[j].steps - 1;
  if (!chain.Contains(grid.At(GridIndex{})) || !chain.Contains(grid.At(last))) {
    throw std::invalid_argument("the grid goes beyond the limits of the robot's joints");
  }
  if (!forbidden.Fits(chain.joints().size())) {
    throw std::invalid_argument("a forbidden region bounds a joint that the grid does not have");
  }
}

DrawnPlace DrawnPlaceBetween(const KinematicChain& chain, const ConfigurationGrid& grid,
                             const JointRegions& forbidden, std::span<const double> from,
                             std::span<const double> to) {
  if (!chain.Contains(from) || !chain.Contains(to)) return DrawnPlace::kOutside;
  for (int j = 0; j < grid.dimensions(); ++j) {
    const auto at = static_cast<size_t>(j);
    if (!grid.Place(j, from[at]) || !grid.Place(j, to[at])) return DrawnPlace::kOutside;
  }
  return forbidden.Between(from, to) ? DrawnPlace::kForbidden : DrawnPlace::kOpen;
}

}  // namespace silhouette
