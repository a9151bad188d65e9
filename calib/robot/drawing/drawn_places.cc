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
  const auto is_inside = [&](std::span<const double> q) {
    if (!chain.Contains(q)) return false;
    for (int j = 0; j < grid.dimensions(); ++j) {
      if (!grid.Place(j, q[static_cast<size_t>(j)])) return false;
    }
    return true;
  };
  const bool one = from.data() == to.data() && from.size() == to.size();
  if (!is_inside(from) || (!one && !is_inside(to))) return DrawnPlace::kOutside;
  return forbidden.Between(from, to) ? DrawnPlace::kForbidden : DrawnPlace::kOpen;
}

}  // namespace silhouette
