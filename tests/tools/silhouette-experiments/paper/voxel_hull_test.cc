// SPDX-License-Identifier: Apache-2.0
// Reconstructed space.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/random.h"
#include "tests/tools/silhouette-experiments/paper/small_settings.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"
#include "tools/silhouette-experiments/paper/voxel_hull.h"

namespace silhouette::paper {
namespace {

using Eigen::Vector3d;

constexpr int kEdge = 20;

class VoxelHullTest : public testing::Test {
 protected:
  double Uniform(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random_);
  }
  Sphere RandomSphere() {
    return {{Uniform(-0.6, 0.6), Uniform(-0.6, 0.6), Uniform(-0.6, 0.6)}, Uniform(0.05, 0.2)};
  }
  Spheres RandomSpheres(int count) {
    Spheres spheres;
    for (int i = 0; i < count; ++i) spheres.push_back(RandomSphere());
    return spheres;
  }

  const Settings settings_ = SmallSettings();
  const std::vector<ParallelCamera>& rig_ = settings_.rigs.at("B");
  const VoxelCube cube_{rig_, 1, kEdge};
  Random random_;

  std::vector<ObstacleImage> Look(const Spheres& obstacles, const Spheres& robot) const {
    std::vector<ObstacleImage> images;
    for (const ParallelCamera& camera : rig_) {
      const Mask robot_image = ImageOf(camera, robot, Raster::kTouch);
      images.push_back(ObstacleImage::FromScene(
          ImageOf(camera, obstacles, Raster::kTouch) | robot_image, robot_image));
    }
    return images;
  }
  Vector3d PointIn(int x, int y, int z, const Vector3d& share) const {
    return ((Vector3d(x, y, z) + share).array() * cube_.voxel() - 1).matrix();
  }
  template <typename Visit>
  static void ForEachVoxel(const Visit& visit) {
    for (int z = 0; z < kEdge; ++z) {
      for (int y = 0; y < kEdge; ++y) {
        for (int x = 0; x < kEdge; ++x) visit(x, y, z);
      }
    }
  }
};

TEST_F(VoxelHullTest, HoldsEveryPointOfEveryObstacleAndNoPointThatAViewSeesAmongBackground) {
  const Spheres obstacles = RandomSpheres(3);
  const std::vector<ObstacleImage> images = Look(obstacles, {});
  for (RobotOut out : AllRobotOut()) {
    const VoxelHull hull(cube_, images, 0b1111, {}, out);
    int beside = 0;
    ForEachVoxel([&](int x, int y, int z) {
      for (int i = 0; i < 5; ++i) {
        const Vector3d point =
            PointIn(x, y, z, {Uniform(0.01, 0.99), Uniform(0.01, 0.99), Uniform(0.01, 0.99)});
        if (Touch(obstacles, Spheres{{point, 0}})) {
          EXPECT_TRUE(hull.at(x, y, z)) << NameOf(out);
        }
      }
      // A voxel in the hull touches a foreground pixel in every view: one no farther from the
      // voxel's middle than its own corners, and half a pixel.
      if (!hull.at(x, y, z)) return;
      ++beside;
      for (size_t view = 0; view < rig_.size(); ++view) {
        const Eigen::Vector2d at = rig_[view].Project(PointIn(x, y, z, {0.5, 0.5, 0.5}));
        const double reach =
            std::sqrt(3.0) / 2 * cube_.voxel() * rig_[view].pixels_per_unit() + 0.5;
        const Mask& obstacle = images[view].obstacle();
        bool found = at.x() < reach || at.y() < reach || at.x() > 23 - reach || at.y() > 23 - reach;
        for (int py = 0; py < 24; ++py) {
          for (int px = 0; px < 24; ++px) {
            if (std::abs(px - at.x()) <= reach && std::abs(py - at.y()) <= reach) {
              found = found || obstacle.at(px, py);
            }
          }
        }
        EXPECT_TRUE(found) << NameOf(out) << ", view " << view;
      }
    });
    EXPECT_GT(beside, 0);
  }
}

TEST_F(VoxelHullTest, IsTouchedByASphereIfThatTouchesAnyVoxelOfIt) {
  const VoxelHull hull(cube_, Look(RandomSpheres(3), {}), 0b0111, {}, RobotOut::kBody);
  int touching = 0;
  for (int i = 0; i < 300; ++i) {
    const Sphere sphere = RandomSphere();
    bool touches = false;
    ForEachVoxel([&](int x, int y, int z) {
      if (!hull.at(x, y, z)) return;
      const Vector3d nearest = sphere.centre.cwiseMax(PointIn(x, y, z, Vector3d::Zero()))
                                   .cwiseMin(PointIn(x, y, z, Vector3d::Ones()));
      touches = touches || (nearest - sphere.centre).norm() <= sphere.radius;
    });
    EXPECT_EQ(hull.Touches(Spheres{sphere}), touches);
    touching += touches ? 1 : 0;
  }
  EXPECT_GT(touching, 0);
  EXPECT_LT(touching, 300);
}

TEST_F(VoxelHullTest, WithoutTheBodyStillHoldsWhatNoViewCanTellFromTheRobot) {
  const ArmTable arms(settings_, Variant::kSpatial);
  const Spheres& robot = arms.At(random_() % arms.size());
  const std::vector<ObstacleImage> images = Look({}, robot);
  const VoxelHull without_body(cube_, images, 0b1111, robot, RobotOut::kBody);
  const VoxelHull without_hull(cube_, images, 0b1111, robot, RobotOut::kHull);
  const VoxelHull of_obstacles(cube_, images, 0b1111, robot, RobotOut::kPixels);
  EXPECT_TRUE(without_body.Touches(robot));
  ForEachVoxel([&](int x, int y, int z) {
    EXPECT_FALSE(without_hull.at(x, y, z));
    EXPECT_FALSE(of_obstacles.at(x, y, z));
    // Nothing is left of a voxel within a sphere.
    for (const Sphere& sphere : robot) {
      double farthest = 0;
      for (int corner = 0; corner < 8; ++corner) {
        const Vector3d to = PointIn(x, y, z, Vector3d(corner & 1, corner >> 1 & 1, corner >> 2));
        farthest = std::max(farthest, (to - sphere.centre).norm());
      }
      if (farthest < sphere.radius) {
        EXPECT_FALSE(without_body.at(x, y, z));
      }
    }
  });
}

TEST_F(VoxelHullTest, TheMoreIsTakenOutTheLessIsLeft) {
  const ArmTable arms(settings_, Variant::kSpatial);
  const Spheres& robot = arms.At(random_() % arms.size());
  const std::vector<ObstacleImage> images = Look(RandomSpheres(4), robot);
  for (ViewSet views = 1; views < 16; ++views) {
    const VoxelHull without_hull(cube_, images, views, robot, RobotOut::kHull);
    const VoxelHull of_obstacles(cube_, images, views, robot, RobotOut::kPixels);
    const VoxelHull all_views(cube_, images, 0b1111, robot, RobotOut::kPixels);
    ForEachVoxel([&](int x, int y, int z) {
      EXPECT_LE(of_obstacles.at(x, y, z), without_hull.at(x, y, z));
      EXPECT_LE(all_views.at(x, y, z), of_obstacles.at(x, y, z));
    });
  }
}

TEST_F(VoxelHullTest, WhatDoesNotFitIsRefused) {
  EXPECT_THROW(VoxelCube(rig_, 1, 0), std::invalid_argument);
  EXPECT_THROW(VoxelCube(rig_, 1, VoxelCube::kMostEdge + 1), std::invalid_argument);
  std::vector<ObstacleImage> images = Look({}, {});
  images.pop_back();
  EXPECT_THROW(VoxelHull(cube_, images, 0b0111, {}, RobotOut::kBody), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette::paper
