// SPDX-License-Identifier: Apache-2.0
// The explicit way to test configurations, for comparison (§2): space reconstructed from the
// images, without the robot, and the robot's true shape against what is left.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "server/collision/obstacle_image.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"

namespace silhouette::paper {

// The cube [-half_width, half_width]^3 in voxels, and the pixels that each touches in each view.
// Cannot be changed once made.
class VoxelCube {
 public:
  static constexpr int kMostEdge = 256;

  // `edge`: voxels along an edge of the cube, 1 to kMostEdge, else std::invalid_argument.
  VoxelCube(std::span<const ParallelCamera> cameras, double half_width, int edge);

  int edge() const { return edge_; }
  double voxel() const { return 2 * half_width_ / edge_; }  // edge length
  double half_width() const { return half_width_; }
  int views() const { return static_cast<int>(touched_.size()); }

 private:
  friend class VoxelHull;
  // Pixels x0 <= x < x1, y0 <= y < y1; none if any of the voxel is outside the image.
  struct Pixels {
    uint16_t x0 = 0;
    uint16_t y0 = 0;
    uint16_t x1 = 0;
    uint16_t y1 = 0;
  };

  double half_width_;
  int edge_;
  std::vector<std::vector<Pixels>> touched_;  // per view and voxel, x running fastest
};

// How the robot, which is foreground as obstacles are, is kept out of the reconstruction.
enum class RobotOut {
  // Voxels wholly inside its true body are taken away: "just the real robot is removed" (§2).
  kBody,
  // Voxels are taken away that views see, and none with an obstacle pixel: all that the robot alone
  // may have brought in. What it hides in every view goes with it, as in the calibrated test.
  kHull,
  // Only obstacle pixels are reconstructed from, as in the uncalibrated test.
  kPixels,
};

// "hull-minus-body", "hull-minus-robot-hull", "hull-of-obstacles".
std::string NameOf(RobotOut out);
const std::vector<RobotOut>& AllRobotOut();

// The voxels that every view sees as foreground, by any pixel that they touch, without the robot.
// A view does not speak of voxels outside its image.
class VoxelHull {
 public:
  // `images`: one per view of the cube, of which those of `views` are looked at. `robot`: at its
  // present configuration. Refers to the cube, which must outlive it. Throws std::invalid_argument
  // if there are more or fewer images than views.
  VoxelHull(const VoxelCube& cube, std::span<const ObstacleImage> images, ViewSet views,
            std::span<const Sphere> robot, RobotOut out);

  // Whether any sphere touches any voxel.
  bool Touches(std::span<const Sphere> spheres) const;
  // Whether a voxel is in it.
  bool at(int x, int y, int z) const { return (Row(y, z)[x / 64] >> (x % 64) & 1) != 0; }

 private:
  uint64_t* Row(int y, int z) {
    return bits_.data() + static_cast<size_t>(z * cube_.edge() + y) * row_words_;
  }
  const uint64_t* Row(int y, int z) const {
    return bits_.data() + static_cast<size_t>(z * cube_.edge() + y) * row_words_;
  }
  void Carve(std::span<const ObstacleImage> images, ViewSet views, RobotOut out);
  void TakeAway(const Sphere& sphere);
  void Summarise();
  bool Touches(const Sphere& sphere) const;

  const VoxelCube& cube_;
  size_t row_words_;
  std::vector<uint64_t> bits_;     // per row along x
  std::vector<uint64_t> rows_;     // per z: the y of rows with any voxel
  std::vector<uint64_t> columns_;  // per z: the x that any row has
};

// The configurations whose arm touches the hull.
ConfigurationSet Touching(const VoxelHull& hull, const ArmTable& arms);

}  // namespace silhouette::paper
