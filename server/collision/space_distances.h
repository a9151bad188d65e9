// SPDX-License-Identifier: Apache-2.0
// SpaceDistances: how far a convex body is from sets of voxels.
//
// Cannot be changed once made; used by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/collision/placed_hull.h"
#include "server/collision/voxel_grid.h"

namespace silhouette {

// A set of voxels and its grid.
struct VoxelsOfGrid {
  const VoxelSet& set;
  const VoxelGrid& grid;
};

class SpaceDistances {
 public:
  // From the voxels of all sets, and from all that is beyond `known`, if it is stated. Distances
  // above `range`, metres, are taken for it. Throws std::invalid_argument if there is no set, one
  // is not of its grid, or the range is not positive.
  SpaceDistances(const std::vector<VoxelsOfGrid>& sets, double range,
                 const std::optional<Eigen::AlignedBox3d>& known = std::nullopt);

  double range() const { return range_; }

  // Metres, to the nearest point of any voxel, less than the true distance by up to
  // PlacedHull::kPrecision; or `at_most` (no more than the range) if it is that far or farther.
  // 0 if the centre of the body's ball is not in the first set's grid: of that nothing is known.
  double Distance(const PlacedHull& body, double at_most) const;

 private:
  // Voxels of a block, of which there is at least one.
  struct Block {
    Eigen::Vector3d lower;
    double edge = 0;               // of a voxel
    Eigen::AlignedBox3d voxels{};  // holds those of the set
    std::array<uint8_t, size_t{VoxelGrid::kBlockEdge} * VoxelGrid::kBlockEdge> rows{};  // y fastest
    // Voxels [first, last) of a row.
    Eigen::AlignedBox3d Box(size_t row, int first, int last) const;
  };
  // Blocks [first, last), which are beside each other.
  struct Group {
    Eigen::AlignedBox3d voxels{};
    size_t first = 0;
    size_t last = 0;
  };

  void AddGroup(const VoxelsOfGrid& voxels, const std::vector<bool>& with_voxels,
                const Eigen::Vector3i& first);
  // The block whose voxels begin nearest to the ball of the body, no farther than `at_most`; or
  // null.
  const Block* NearestBlock(const PlacedHull& body, double at_most) const;
  // From the body to all that is beyond what is known, at most the range.
  double ToUnknown(const PlacedHull& body) const;
  // Lowers the distance to that from the body to the block's voxels.
  static void Measure(const Block& block, const PlacedHull& body, PlacedHull::Plane& plane,
                      double& distance);

  Eigen::AlignedBox3d grid_;
  double range_;
  std::optional<Eigen::AlignedBox3d> known_;
  std::vector<Block> blocks_;
  std::vector<Group> groups_;
};

}  // namespace silhouette
