// SPDX-License-Identifier: Apache-2.0
// Which obstacles a cell can tell from the robot.
#include "server/collision/resolution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace silhouette {
namespace {

// 3 m above the workspace's middle; at a focal length of 64 pixels one of them is 4.7 cm wide
// there.
CameraModel CameraOf(int pixels) {
  Eigen::Isometry3d camera_from_world = Eigen::Isometry3d::Identity();
  camera_from_world.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera_from_world.translation() = Eigen::Vector3d(0, 0, 3.5);
  const double middle = (pixels - 1) / 2.0;
  return {{.width = pixels,
           .height = pixels,
           .fx = 1.0 * pixels,
           .fy = 1.0 * pixels,
           .cx = middle,
           .cy = middle},
          camera_from_world};
}

const Eigen::AlignedBox3d kWorkspace(Eigen::Vector3d(-1, -1, 0), Eigen::Vector3d(1, 1, 1));

TEST(Resolution, FinerMasksResolveSmallerObstacles) {
  const std::vector coarse = {CameraOf(64)};
  const std::vector fine = {CameraOf(128)};
  const double of_coarse = ResolvableObstacle({.cameras = coarse, .workspace = kWorkspace});
  EXPECT_NEAR(of_coarse, 2 * ResolvableObstacle({.cameras = fine, .workspace = kWorkspace}), 1e-6);
  EXPECT_GT(of_coarse, 3.0 / 64);
  EXPECT_LT(of_coarse, 2 * 3.0 / 64);
}

TEST(Resolution, MasksOfTheSizeThatIsAskedForResolveTheObstacle) {
  const std::vector coarse = {CameraOf(64)};
  const ResolutionInput input{
      .cameras = coarse, .margin = 0, .workspace = kWorkspace, .model_tolerance = 0.005};
  const double scale = MaskScaleFor(input, 0.03);
  EXPECT_GT(scale, 1);
  const std::vector finer = {CameraOf(static_cast<int>(std::ceil(64 * scale)))};
  EXPECT_LE(
      ResolvableObstacle({.cameras = finer, .workspace = kWorkspace, .model_tolerance = 0.005}),
      0.03);
  EXPECT_LE(MaskScaleFor(input, ResolvableObstacle(input)), 1 + 1e-9);
}

TEST(Resolution, CoarsestViewAndAllTolerancesCount) {
  const std::vector both = {CameraOf(128), CameraOf(64)};
  const std::vector coarse = {CameraOf(64)};
  const ResolutionInput plain{.cameras = coarse, .workspace = kWorkspace};
  EXPECT_EQ(ResolvableObstacle({.cameras = both, .workspace = kWorkspace}),
            ResolvableObstacle(plain));
  EXPECT_GT(ResolvableObstacle({.cameras = coarse, .margin = 0.5, .workspace = kWorkspace}),
            ResolvableObstacle(plain));
  EXPECT_GT(
      ResolvableObstacle({.cameras = coarse, .workspace = kWorkspace, .model_tolerance = 0.01}),
      ResolvableObstacle(plain));
  EXPECT_TRUE(std::isinf(
      MaskScaleFor({.cameras = coarse, .workspace = kWorkspace, .model_tolerance = 0.1}, 0.05)));
}

TEST(Resolution, NothingIsSaidOfAWorkspaceThatNoCameraSees) {
  const std::vector cameras = {CameraOf(64)};
  EXPECT_EQ(ResolvableObstacle({.cameras = cameras,
                                .workspace = Eigen::AlignedBox3d(Eigen::Vector3d(50, 50, 0),
                                                                 Eigen::Vector3d(51, 51, 1))}),
            0);
}

}  // namespace
}  // namespace silhouette
