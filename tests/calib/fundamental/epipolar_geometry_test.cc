// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/epipolar_geometry.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/calib/fundamental/seen_cell.h"

namespace silhouette {
namespace {

class Points {
 public:
  explicit Points(uint32_t seed) : random_(seed) {}
  Eigen::Vector3d Next() { return {Any(), Any(), 0.9 + Any()}; }

 private:
  double Any() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
  std::mt19937 random_;
};

TEST(EpipolarGeometry, PointsLieOnTheLinesOfTheirImages) {
  const auto cameras = CellCameras();
  const CameraModel& a = cameras[0].model;
  const CameraModel& b = cameras[2].model;
  const Eigen::Matrix3d f = FundamentalBetween(a, b);
  EXPECT_NEAR(f.norm(), 1, 1e-12);
  EXPECT_NEAR(f.determinant(), 0, 1e-15);
  Points points(1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d point = points.Next();
    const EpipolarDistance distance = DistanceBetween(f, *a.Project(point), *b.Project(point));
    EXPECT_LT(distance.in_a, 1e-9);
    EXPECT_LT(distance.in_b, 1e-9);
  }
}

TEST(EpipolarGeometry, ScalingKeepsHalfPixelsPerAxis) {
  const auto cameras = CellCameras();
  const CameraModel& a = cameras[0].model;
  const CameraModel& b = cameras[1].model;
  const Eigen::Matrix3d scaled =
      ScaledTo(FundamentalBetween(a, b), {640, 480}, {64, 64}, {640, 480}, {100, 32});
  const Eigen::Matrix3d of_scaled = FundamentalBetween(a.ScaledTo(64, 64), b.ScaledTo(100, 32));
  const double sign = scaled.cwiseProduct(of_scaled).sum() > 0 ? 1 : -1;
  EXPECT_LT((sign * scaled / scaled.norm() - of_scaled).norm(), 1e-12);
  const Eigen::Vector2d point(123.25, 17.5);
  EXPECT_LT((ScaledTo(point, {640, 480}, {64, 64}) - Eigen::Vector2d(11.875, 1.9)).norm(), 1e-12);
}

TEST(EpipolarGeometry, ScalingWithoutTheHalfPixelWouldMiss) {
  // What is lost by f' = f / s, c' = c / s, as facts have it: 0.45 mask pixels at s = 10.
  EXPECT_NEAR(
      (ScaledTo(Eigen::Vector2d(100, 100), {640, 640}, {64, 64}) - Eigen::Vector2d(100, 100) / 10)
          .x(),
      -0.45, 1e-12);
}

TEST(EpipolarGeometry, CamerasAtOnePlaceHaveNoMatrix) {
  const CameraModel camera = CellCameras()[0].model;
  EXPECT_THROW(FundamentalBetween(camera, camera), std::invalid_argument);
}

TEST(EpipolarGeometry, DistancesAreThoseFromTheLines) {
  // Images side by side: lines are rows.
  Eigen::Matrix3d f;
  f << 0, 0, 0, 0, 0, -1, 0, 1, 0;
  const EpipolarDistance distance = DistanceBetween(f, {5, 7}, {90, 7.5});
  EXPECT_DOUBLE_EQ(distance.in_a, 0.5);
  EXPECT_DOUBLE_EQ(distance.in_b, 0.5);
  EXPECT_DOUBLE_EQ(NeededMargin(f, {5, 7}, {90, 7.5}), 0.25);
  EXPECT_NEAR(std::abs(SampsonDistance(f, {5, 7}, 0.3, {90, 7.5}, 0.4)), 1, 1e-12);
}

TEST(LensBow, GrowsWithTheDistortionAndIsNothingWithoutIt) {
  double last = 0;
  for (const double k1 : {0.0, -0.05, -0.2, -0.35}) {
    const auto cameras = CellCameras(k1);
    const LensBow bow = BowBetween(cameras[0].model, cameras[1].model, SizesOf(cameras[0].model),
                                   SizesOf(cameras[1].model), 10);
    if (k1 == 0) {
      EXPECT_EQ(bow.curve, 0);
      EXPECT_EQ(bow.margin, 0);
      continue;
    }
    EXPECT_GT(bow.curve, last + 1);
    EXPECT_GT(bow.off_lines, bow.curve / 2);
    EXPECT_GT(bow.margin, 0.1);
    last = bow.curve;
  }
  EXPECT_LT(last, 80);
}

TEST(LensBow, CornersThatAreUndistortedFitTheMatrix) {
  const auto cameras = CellCameras(-0.2);
  const Eigen::Matrix3d f = FundamentalBetween(cameras[0].model, cameras[1].model);
  Points points(2);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d point = points.Next();
    Correspondence corner;
    corner.a = *cameras[0].model.Project(point);
    corner.b = *cameras[1].model.Project(point);
    const auto undistorted = Undistorted(cameras[0].model, cameras[1].model, corner);
    ASSERT_TRUE(undistorted);
    EXPECT_LT(DistanceBetween(f, undistorted->a, undistorted->b).in_b, 1e-6);
  }
}

}  // namespace
}  // namespace silhouette
