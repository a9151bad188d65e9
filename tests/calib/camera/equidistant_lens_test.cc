// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/equidistant_lens.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/random.h"

namespace silhouette {
namespace {

constexpr double kFisheyeDegree = std::numbers::pi / 180;

// An image whose corner sees at `widest` radians through the lens k = 0.
CameraIntrinsics FisheyeImage(double widest) {
  CameraIntrinsics in{.width = 1280, .height = 960, .cx = 645, .cy = 470};
  in.fx = in.fy = std::hypot(645.5, 489.5) / widest;
  return in;
}

TEST(EquidistantLens, IsHeldToAFewHundredthsOfAPixelByLensesOfMachineVision) {
  Random random;
  const auto near = [&](double most) {
    return std::uniform_real_distribution<double>(-most, most)(random);
  };
  for (int trial = 0; trial < 200; ++trial) {
    const double widest = (30 + 35.0 * trial / 200) * kFisheyeDegree;
    const CameraIntrinsics image = FisheyeImage(widest);
    const std::array<double, 4> k = {near(0.03), near(0.01), near(0.003), near(0.001)};
    const EquidistantFit fit = NearestToEquidistant(image, k);
    EXPECT_LT(fit.worst, 0.05) << "trial " << trial;
    const CameraModel camera(fit.intrinsics);
    for (int i = 0; i < 50; ++i) {
      const double angle = 0.9 * widest * std::abs(near(1));
      const double turn = near(std::numbers::pi);
      const Eigen::Vector3d along(std::sin(angle) * std::cos(turn),
                                  std::sin(angle) * std::sin(turn), std::cos(angle));
      const double a2 = angle * angle;
      const double distance =
          angle * (1 + k[0] * a2 + k[1] * a2 * a2 + k[2] * a2 * a2 * a2 + k[3] * a2 * a2 * a2 * a2);
      const Eigen::Vector2d truth =
          Eigen::Vector2d(image.cx, image.cy) +
          image.fx * distance * Eigen::Vector2d(std::cos(turn), std::sin(turn));
      const auto shown = camera.Project(along);
      ASSERT_TRUE(shown) << "trial " << trial;
      EXPECT_LT((*shown - truth).norm(), fit.worst + 1e-6);
      const auto ray = camera.Ray(truth);
      ASSERT_TRUE(ray) << "trial " << trial;
      EXPECT_LT(std::acos(std::min(ray->dot(along), 1.0)) * image.fx, 2 * fit.worst + 1e-3);
    }
  }
}

TEST(EquidistantLens, WhatNoPlaneHoldsIsRefused) {
  EXPECT_NO_THROW(NearestToEquidistant(FisheyeImage(75 * kFisheyeDegree), {}));
  EXPECT_THROW(NearestToEquidistant(FisheyeImage(86 * kFisheyeDegree), {}), std::invalid_argument);
  EXPECT_THROW(NearestToEquidistant(FisheyeImage(1), {-0.5, 0, 0, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
