// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <cmath>
#include <random>

#include "calib/camera/camera_model.h"
#include "tests/random.h"

namespace silhouette {
namespace {

CameraIntrinsics Plain() {
  return {.width = 640, .height = 480, .fx = 500, .fy = 510, .cx = 320, .cy = 239};
}

CameraIntrinsics Distorted(std::array<double, 8> distortion) {
  CameraIntrinsics intrinsics = Plain();
  intrinsics.distortion = distortion;
  return intrinsics;
}

// Looks along world x from (-2, 0, 1), world z is up.
Eigen::Isometry3d SomePose() {
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  world_from_camera.linear().col(0) = -Eigen::Vector3d::UnitY();
  world_from_camera.linear().col(1) = -Eigen::Vector3d::UnitZ();
  world_from_camera.linear().col(2) = Eigen::Vector3d::UnitX();
  world_from_camera.translation() = Eigen::Vector3d(-2, 0, 1);
  return world_from_camera.inverse();
}

TEST(CameraModel, ProjectsAsAPinhole) {
  const CameraModel camera(Plain(), SomePose());
  EXPECT_TRUE(camera.Centre().isApprox(Eigen::Vector3d(-2, 0, 1)));
  // 2 m ahead, 0.2 m to the left, 0.4 m up.
  const auto pixel = camera.Project({0, 0.2, 1.4});
  ASSERT_TRUE(pixel.has_value());
  EXPECT_NEAR(pixel->x(), 320 - 500 * 0.1, 1e-9);
  EXPECT_NEAR(pixel->y(), 239 - 510 * 0.2, 1e-9);
  EXPECT_TRUE(camera.Contains(*pixel));
}

TEST(CameraModel, PointBehindTheCameraIsNotSeen) {
  const CameraModel camera(Plain(), SomePose());
  EXPECT_FALSE(camera.Project({-3, 0, 1}).has_value());
  EXPECT_FALSE(camera.Project({-2, 0, 1}).has_value());
}

// By hand from OpenCV's documentation, at x = 0.3, y = -0.2: r^2 = 0.13.
TEST(CameraModel, DistortsAsOpenCvDoes) {
  const CameraModel camera(Distorted({-0.2, 0.05, 0.001, -0.002, 0.01, 0.1, 0.02, 0.003}));
  const double r2 = 0.13;
  const double radial = (1 - 0.2 * r2 + 0.05 * r2 * r2 + 0.01 * r2 * r2 * r2) /
                        (1 + 0.1 * r2 + 0.02 * r2 * r2 + 0.003 * r2 * r2 * r2);
  const double x = 0.3 * radial + 2 * 0.001 * -0.06 - 0.002 * (r2 + 2 * 0.09);
  const double y = -0.2 * radial + 0.001 * (r2 + 2 * 0.04) + 2 * -0.002 * -0.06;
  const auto pixel = camera.Project({0.6, -0.4, 2});
  ASSERT_TRUE(pixel.has_value());
  EXPECT_NEAR(pixel->x(), 500 * x + 320, 1e-9);
  EXPECT_NEAR(pixel->y(), 510 * y + 239, 1e-9);
}

TEST(CameraModel, RayOfAPixelProjectsBackToIt) {
  Random random;
  std::uniform_real_distribution<double> x(-0.5, 639.5), y(-0.5, 479.5), depth(0.1, 10);
  for (const std::array<double, 8>& distortion :
       std::vector<std::array<double, 8>>{{},
                                          {-0.35, 0.12, 0.001, -0.0005, -0.02},
                                          {0.2, 0.1, 0, 0, 0},
                                          {0.3, -0.1, 0.002, 0.001, 0.05, 0.6, -0.05, 0.02}}) {
    const CameraModel camera(Distorted(distortion), SomePose());
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector2d pixel(x(random), y(random));
      const auto ray = camera.Ray(pixel);
      ASSERT_TRUE(ray.has_value()) << pixel.transpose();
      EXPECT_NEAR(ray->norm(), 1, 1e-12);
      const auto back = camera.Project(camera.Centre() + depth(random) * *ray);
      ASSERT_TRUE(back.has_value());
      EXPECT_LT((*back - pixel).norm(), 1e-6);
    }
  }
}

TEST(CameraModel, NothingIsSeenBeyondTheDistortionsFold) {
  // r (1 - 0.35 r^2) is largest at r = 0.976, where it is 0.65.
  const CameraModel camera(Distorted({-0.35}));
  EXPECT_TRUE(camera.Project({0.97, 0, 1}).has_value());
  EXPECT_FALSE(camera.Project({0.98, 0, 1}).has_value());
  EXPECT_FALSE(camera.Project({1.6, 0, 1}).has_value());
  EXPECT_TRUE(camera.Ray({320 + 500 * 0.64, 239}).has_value());
  EXPECT_FALSE(camera.Ray({320 + 500 * 0.66, 239}).has_value());
}

TEST(CameraModel, ScalingKeepsThePixelsPlacesOnTheImage) {
  const CameraModel camera(Distorted({-0.2, 0.05}), SomePose());
  const CameraModel mask = camera.ScaledTo(64, 64);
  const Eigen::Vector3d point(0.3, 0.2, 1.4);
  const Eigen::Vector2d in_image = *camera.Project(point);
  const Eigen::Vector2d in_mask = *mask.Project(point);
  // The distance from the image's left or upper rim, as a share of its width or height.
  EXPECT_NEAR((in_mask.x() + 0.5) / 64, (in_image.x() + 0.5) / 640, 1e-12);
  EXPECT_NEAR((in_mask.y() + 0.5) / 64, (in_image.y() + 0.5) / 480, 1e-12);
}

TEST(CameraModel, NonsenseIsRefused) {
  CameraIntrinsics intrinsics = Plain();
  intrinsics.fx = 0;
  EXPECT_THROW(CameraModel(intrinsics, SomePose()), std::invalid_argument);
  intrinsics = Plain();
  intrinsics.height = 0;
  EXPECT_THROW(CameraModel(intrinsics, SomePose()), std::invalid_argument);
  intrinsics = Plain();
  intrinsics.distortion[7] = std::nan("");
  EXPECT_THROW(CameraModel(intrinsics, SomePose()), std::invalid_argument);
}

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
  Random random;
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
