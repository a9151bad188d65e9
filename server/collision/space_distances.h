// SPDX-License-Identifier: Apache-2.0
// SpaceDistances: how far points are from sets of voxels.
//
// A bound is one look-up in a map of distances; the exact distance is measured to the boxes of the
// voxels. Cannot be changed once made; used by any number of threads. Two bytes a voxel of the map.
//
// `asked` is where distances will be asked for most: the map covers it, and beyond it bounds are as
// much less as the point is away from it.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/collision/voxel_grid.h"

namespace silhouette {

// A set of voxels and its grid, which must outlive it.
struct VoxelsOfGrid {
  const VoxelSet& set;
  const VoxelGrid& grid;
};

class SpaceDistances {
 public:
  // From the voxels of all sets, and from all that is beyond `known`, if it is stated. The map has
  // voxels of the grid of the first set, those that have a part of `asked`; nothing: all. Distances
  // above `range`, metres, are taken for it. Throws std::invalid_argument if there is no set, one
  // is not of its grid, `asked` and the grid have nothing in common, or the range is not positive
  // or more than 127 edges of a voxel of the map.
  SpaceDistances(const std::vector<VoxelsOfGrid>& sets, double range,
                 const std::optional<Eigen::AlignedBox3d>& known = std::nullopt,
                 const std::optional<Eigen::AlignedBox3d>& asked = std::nullopt);

  double range() const { return range_; }

  // A lower bound of the distance, metres, from the point to any point of any voxel: that between
  // the boxes of voxels of the map. 0 where the point is not in the grid, of which nothing is
  // known.
  double AtLeast(const Eigen::Vector3d& point) const;

  // The distance, metres, from the point to the nearest point of any voxel, or `at_most` (no more
  // than the range) if it is that far or farther. 0 where the point is not in the grid.
  double Distance(const Eigen::Vector3d& point, double at_most) const;

 private:
  // Voxels of a block, of which there is at least one.
  struct Block {
    Eigen::Vector3d lower;
    double edge = 0;               // of a voxel
    Eigen::AlignedBox3d voxels{};  // holds those of the set
    std::array<uint8_t, size_t{VoxelGrid::kBlockEdge} * VoxelGrid::kBlockEdge> rows{};  // y fastest
  };

  // From the point to all that is beyond what is known, at most the range.
  double ToUnknown(const Eigen::Vector3d& point) const;
  void AddBlocks(const VoxelsOfGrid& voxels);
  void PlaceMap(const Eigen::AlignedBox3d& asked);
  void FillMap(const VoxelSet& voxels);
  // Lowers `square`, of a distance, to that from the point to the block's voxels.
  static void Measure(const Block& block, const Eigen::Vector3d& point, double& square);

  VoxelGrid grid_;
  double range_;
  std::optional<Eigen::AlignedBox3d> known_;
  Eigen::Vector3i first_ = Eigen::Vector3i::Zero();  // voxel of the map, and how many
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<int16_t> squares_;  // by voxel of the map, x fastest: squares of edges
  std::vector<Block> blocks_;
};

}  // namespace silhouette
