// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_model.h"

#include <gtest/gtest.h>

#include <random>

namespace silhouette {
namespace {

CameraModel CameraAtOrigin(std::array<double, 8> distortion = {}) {
  return {{.width = 64,
           .height = 48,
           .fx = 60,
           .fy = 50,
           .cx = 31.5,
           .cy = 23.5,
           .distortion = distortion},
          Eigen::Isometry3d::Identity()};
}

TEST(PixelsPerMetre, IsTheFocalLengthOverTheLeastDistanceOnTheAxis) {
  const Eigen::AlignedBox3d thin(Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(0, 0, 3));
  EXPECT_NEAR(*PixelsPerMetre(CameraAtOrigin(), thin), 30, 1e-3);
}

TEST(PixelsPerMetre, BoundsEverySmallMoveInTheBox) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> number(-1, 1);
  const CameraModel camera = CameraAtOrigin({-0.2, 0.05, 1e-3, 1e-3, 0, 0, 0, 0});
  const Eigen::AlignedBox3d box(Eigen::Vector3d(-1, -0.6, 2), Eigen::Vector3d(0.7, 1, 4));
  const double scale = *PixelsPerMetre(camera, box);
  int seen = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d from =
        box.center() + 0.5 * box.sizes().cwiseProduct(
                                 Eigen::Vector3d(number(random), number(random), number(random)));
    const Eigen::Vector3d move =
        0.02 * Eigen::Vector3d(number(random), number(random), number(random));
    if (!box.contains(from + move)) continue;
    const auto a = camera.Project(from), b = camera.Project(from + move);
    if (!a || !b || !camera.Contains(*a) || !camera.Contains(*b)) continue;
    ++seen;
    // The lattice may miss the very largest by a little.
    ASSERT_LE((*a - *b).norm(), 1.01 * scale * move.norm());
  }
  EXPECT_GT(seen, 1000);
}

TEST(PixelsPerMetre, IsZeroForWhatIsNotSeenAndUnknownForTheCameraItself) {
  const Eigen::AlignedBox3d behind(Eigen::Vector3d(-1, -1, -3), Eigen::Vector3d(1, 1, -1));
  EXPECT_EQ(PixelsPerMetre(CameraAtOrigin(), behind), 0);
  const Eigen::AlignedBox3d around(Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1));
  EXPECT_EQ(PixelsPerMetre(CameraAtOrigin(), around), std::nullopt);
}

}  // namespace
}  // namespace silhouette
