// How one view sees blocks of voxels: the geometry behind VoxelSpace.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "server/collision/voxel_space.h"

namespace silhouette {

// A rectangle of the image plane, in pixel coordinates.
using PlaneBox = Eigen::AlignedBox2d;

// Fills in a VoxelSpace::Look, block by block.
class VoxelLooker {
 public:
  // Refers to `view`, `grid` and `look`, which must outlive it.
  VoxelLooker(const VoxelView& view, const VoxelGrid& grid, double least_obstacle,
              VoxelSpace::Look& look);

  // The pixels that any voxel of a block may touch; not whole where one may be out of the image.
  PixelRectangle BlockRectangle(const VoxelSpace::Block& block);

  // Appends the block's voxels.
  void Append(const VoxelSpace::Block& block);

 private:
  static constexpr int kCorners = VoxelGrid::kBlockEdge + 1;

  void ProjectCorners(const VoxelSpace::Block& block);
  const std::optional<Eigen::Vector2d>& Corner(int x, int y, int z) const {
    return corners_[static_cast<size_t>((z * kCorners + y) * kCorners + x)];
  }
  // Where the voxel or block between two corners appears.
  std::optional<PlaneBox> Image(int x, int y, int z, int edges) const;
  PixelRectangle Pixels(const std::optional<PlaneBox>& image) const;
  uint32_t TouchedIndex(const PixelRectangle& pixels);
  // Semi-axes of an ellipse that the image of a ball with its centre in the block surely fills,
  // about the image of its centre; nothing if it is not sure to fill anything.
  std::optional<Eigen::Vector2d> BallAxes(const VoxelSpace::Block& block) const;
  uint32_t CertainIndex(const PlaneBox& centres, const Eigen::Vector2d& axes);

  const VoxelView& view_;
  const VoxelGrid& grid_;
  double least_obstacle_;
  VoxelSpace::Look& look_;

  std::vector<std::optional<Eigen::Vector2d>> corners_;
  double bulge_ = 0;  // pixels by which a voxel's image may exceed its corners'
  std::map<VoxelSpace::RectangleKind, uint32_t> kinds_;
  std::map<std::array<int, 6>, uint32_t> quantised_;
  std::map<PixelShape, uint32_t> shapes_;
};

}  // namespace silhouette
