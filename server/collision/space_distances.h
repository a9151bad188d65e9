// SPDX-License-Identifier: Apache-2.0
// SpaceDistances: how far points are from a set of voxels, at least.
//
// Cannot be changed once made; used by any number of threads. Two bytes a voxel of the grid.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "server/collision/voxel_grid.h"

namespace silhouette {

class SpaceDistances {
 public:
  // Distances above `range`, metres, are taken for it. Throws std::invalid_argument if the set is
  // not of the grid, or the range is not positive or more than 127 edges of a voxel.
  SpaceDistances(const VoxelSet& voxels, const VoxelGrid& grid, double range);

  double range() const { return range_; }

  // A lower bound of the distance, metres, from the point to any point of any voxel of the set:
  // that between the boxes of the voxels. 0 where the point is not in the grid, of which nothing is
  // known.
  double AtLeast(const Eigen::Vector3d& point) const;

 private:
  VoxelGrid grid_;
  double range_;
  std::vector<int16_t> squares_;  // by voxel, x fastest: squares of edges
};

}  // namespace silhouette
