// SPDX-License-Identifier: Apache-2.0
// At which joint values a drawn robot can be asked about. Uses the standard library and Eigen
// alone.
#pragma once

#include <span>

#include "calib/robot/drawing/kinematic_chain.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"

namespace silhouette {

// Throws std::invalid_argument if the chain's joints are not those of the grid, in their order, the
// grid goes beyond their limits, or `forbidden` has joints that the grid does not have.
void RequireDrawnPlaces(const KinematicChain& chain, const ConfigurationGrid& grid,
                        const JointRegions& forbidden);

enum class DrawnPlace {
  kOutside,    // some are beyond the grid's or the robot's limits
  kForbidden,  // none is, and some may be forbidden
  kOpen,
};

// What stands for all joint values between two, along each joint. The three are what
// RequireDrawnPlaces takes.
DrawnPlace DrawnPlaceBetween(const KinematicChain& chain, const ConfigurationGrid& grid,
                             const JointRegions& forbidden, std::span<const double> from,
                             std::span<const double> to);

}  // namespace silhouette
