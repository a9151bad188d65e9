// SPDX-License-Identifier: Apache-2.0
#include "server/collision/epipolar_bands.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/random_geometry.h"

namespace silhouette {
namespace {

struct EpipolarBandsTest : ::testing::Test {
  Random random;

  double Number(double lower, double upper) {
    return std::uniform_real_distribution<double>(lower, upper)(random);
  }

  Eigen::Vector3d Point(double side) {
    return {Number(-side, side), Number(-side, side), Number(-side, side)};
  }

  // 2 to 4 m from the origin, which it looks at.
  CameraModel Camera(MaskSize size, bool distorted) {
    const Eigen::Vector3d centre = Point(1).normalized() * Number(2, 4);
    const Eigen::Vector3d z = (Point(0.3) - centre).normalized();
    const Eigen::Vector3d x = z.unitOrthogonal();
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
    world_from_camera.linear() << x, z.cross(x), z;
    world_from_camera.translation() = centre;
    CameraIntrinsics intrinsics{.width = size.width,
                                .height = size.height,
                                .fx = Number(0.7, 1.2) * size.width,
                                .fy = Number(0.7, 1.2) * size.height,
                                .cx = Number(0.4, 0.6) * size.width,
                                .cy = Number(0.4, 0.6) * size.height};
    if (distorted) intrinsics.distortion = {Number(-0.3, 0.1), 0.05, 1e-3, -1e-3, 0, 0, 0, 0};
    return {intrinsics, world_from_camera.inverse()};
  }
};

int PixelAt(const Eigen::Vector2d& point, int width) {
  return static_cast<int>(std::lround(point.y())) * width +
         static_cast<int>(std::lround(point.x()));
}

// x_b' F x_a = 0 for undistorted cameras.
Eigen::Matrix3d FundamentalMatrixOf(const CameraModel& a, const CameraModel& b) {
  const auto k = [](const CameraModel& camera) {
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
    matrix(0, 0) = camera.intrinsics().fx;
    matrix(1, 1) = camera.intrinsics().fy;
    matrix(0, 2) = camera.intrinsics().cx;
    matrix(1, 2) = camera.intrinsics().cy;
    return matrix;
  };
  const Eigen::Isometry3d b_from_a = b.camera_from_world() * a.camera_from_world().inverse();
  const Eigen::Vector3d t = b_from_a.translation();
  Eigen::Matrix3d across;
  across << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  return k(b).inverse().transpose() * across * b_from_a.linear() * k(a).inverse();
}

TEST_F(EpipolarBandsTest, PixelsThatShowTheSamePointAlwaysMeet) {
  int seen = 0;
  for (int round = 0; round < 12; ++round) {
    // The last sizes have more ends of intervals than bins.
    const MaskSize size = round < 8 ? MaskSize{64, 48} : MaskSize{160, 150};
    const CameraModel a = Camera(size, true);
    const CameraModel b = Camera(size, true);
    const EpipolarBands bands({.cameras = {a, b}, .fundamental_matrices = {}},
                              std::vector<MaskSize>{size, size});
    EXPECT_LE(bands.bins(0, 1), EpipolarBands::kMaxBins);
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d point = Point(1.2);
      const auto in_a = a.Project(point);
      const auto in_b = b.Project(point);
      if (!in_a || !in_b || !a.Contains(*in_a) || !b.Contains(*in_b)) continue;
      ++seen;
      ASSERT_TRUE(bands.Meet(0, PixelAt(*in_a, size.width), 1, PixelAt(*in_b, size.width)));
    }
  }
  EXPECT_GT(seen, 5000);
}

// A pixel beyond the lines of all points of the other's square, be it by a twentieth of a pixel, is
// not in its band.
TEST_F(EpipolarBandsTest, AreNoWiderThanTheLinesOfThePixelsSquare) {
  const MaskSize size{32, 24};
  int apart = 0;
  int wrong = 0;
  for (int round = 0; round < 8; ++round) {
    const CameraModel a = Camera(size, false);
    const CameraModel b = Camera(size, false);
    const Eigen::Matrix3d f = FundamentalMatrixOf(a, b);
    const std::vector<MaskSize> sizes = {size, size};
    const EpipolarBands by_cameras({.cameras = {a, b}, .fundamental_matrices = {}}, sizes);
    const EpipolarBands by_matrix({.cameras = {}, .fundamental_matrices = {{0, 1, f}}}, sizes);
    const EpipolarBands turned({.cameras = {}, .fundamental_matrices = {{1, 0, f.transpose()}}},
                               sizes);
    for (int i = 0; i < 3000; ++i) {
      const int px = static_cast<int>(random() % 32), py = static_cast<int>(random() % 24);
      const int qx = static_cast<int>(random() % 32), qy = static_cast<int>(random() % 24);
      // q' F p is affine in p and in q: over two squares it is zero somewhere exactly if it has
      // both signs at their corners.
      int above = 0;
      for (int corner = 0; corner < 16; ++corner) {
        const Eigen::Vector3d line =
            f * Eigen::Vector3d(px + (corner & 1 ? 0.5 : -0.5), py + (corner & 2 ? 0.5 : -0.5), 1);
        const Eigen::Vector3d point(qx + (corner & 4 ? 0.55 : -0.55),
                                    qy + (corner & 8 ? 0.55 : -0.55), 1);
        if (line.dot(point) > 0) ++above;
      }
      const bool met = above != 0 && above != 16;
      const int p = py * 32 + px, q = qy * 32 + qx;
      EXPECT_EQ(by_matrix.Meet(0, p, 1, q), turned.Meet(0, p, 1, q));
      EXPECT_EQ(by_matrix.Meet(0, p, 1, q), by_matrix.Meet(1, q, 0, p));
      // Camera models know on which side of the cameras' axis a pixel looks; a matrix does not.
      EXPECT_LE(by_cameras.Meet(0, p, 1, q), by_matrix.Meet(0, p, 1, q));
      if (met) continue;
      ++apart;
      if (by_matrix.Meet(0, p, 1, q)) ++wrong;
    }
  }
  EXPECT_GT(apart, 3000);
  EXPECT_EQ(wrong, 0) << "of " << apart;
}

TEST(EpipolarBands, OfParallelViewsWithACommonAxisAreSingleRows) {
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();
  f(1, 2) = 1;
  f(2, 1) = -1;
  const EpipolarBands bands({.cameras = {}, .fundamental_matrices = {{0, 1, f}}},
                            std::vector<MaskSize>{{7, 5}, {3, 5}});
  for (int p = 0; p < 35; ++p) {
    for (int q = 0; q < 15; ++q) EXPECT_EQ(bands.Meet(0, p, 1, q), p / 7 == q / 3);
  }
  EXPECT_LE(bands.bins(0, 1), 7);
}

TEST(EpipolarBands, PixelThatShowsTheOtherCameraMeetsEveryPixel) {
  // x_b' [e] x_a = 0 with both epipoles at pixel (2, 1).
  Eigen::Matrix3d f;
  f << 0, -1, 1, 1, 0, -2, -1, 2, 0;
  const EpipolarBands bands({.cameras = {}, .fundamental_matrices = {{0, 1, f}}},
                            std::vector<MaskSize>{{5, 4}, {5, 4}});
  for (int q = 0; q < 20; ++q) EXPECT_TRUE(bands.Meet(0, 1 * 5 + 2, 1, q));
  EXPECT_FALSE(bands.Meet(0, 0, 1, 4));
}

TEST(EpipolarBands, WidenWithTheMarginOfTheCalibration) {
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();
  f(1, 2) = 1;
  f(2, 1) = -1;
  const EpipolarBands bands({.cameras = {}, .fundamental_matrices = {{0, 1, f}}},
                            std::vector<MaskSize>{{1, 9}, {1, 9}}, 0.6);
  for (int p = 0; p < 9; ++p) {
    for (int q = 0; q < 9; ++q) EXPECT_EQ(bands.Meet(0, p, 1, q), std::abs(p - q) <= 2);
  }
}

TEST(EpipolarBands, PairThatNothingIsKnownOfMeetsEverywhere) {
  const EpipolarBands bands({}, std::vector<MaskSize>{{4, 4}, {2, 2}});
  EXPECT_FALSE(bands.Known(0, 1));
  for (int p = 0; p < 16; ++p) {
    for (int q = 0; q < 4; ++q) EXPECT_TRUE(bands.Meet(0, p, 1, q));
  }
}

TEST(EpipolarBands, WhatCannotBeACalibrationIsRefused) {
  const std::vector<MaskSize> sizes = {{4, 4}, {4, 4}};
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();
  f(1, 2) = 1;
  f(2, 1) = -1;
  const auto make = [&](std::vector<FundamentalMatrix> matrices) {
    EpipolarBands({.cameras = {}, .fundamental_matrices = std::move(matrices)}, sizes);
  };
  EXPECT_NO_THROW(make({{0, 1, f}}));
  EXPECT_THROW(make({{0, 2, f}}), std::invalid_argument);
  EXPECT_THROW(make({{1, 1, f}}), std::invalid_argument);
  EXPECT_THROW(make({{-1, 1, f}}), std::invalid_argument);
  EXPECT_THROW(make({{0, 1, f}, {1, 0, f}}), std::invalid_argument);
  EXPECT_THROW(make({{0, 1, Eigen::Matrix3d::Identity()}}), std::invalid_argument);
  EXPECT_THROW(make({{0, 1, Eigen::Matrix3d::Zero()}}), std::invalid_argument);
  EXPECT_THROW(make({{0, 1, f * std::nan("")}}), std::invalid_argument);
  const CameraModel camera({.width = 4, .height = 4, .fx = 4, .fy = 4, .cx = 2, .cy = 2},
                           Eigen::Isometry3d::Identity());
  const auto with_cameras = [&](std::vector<CameraModel> cameras, double margin) {
    EpipolarBands({.cameras = std::move(cameras), .fundamental_matrices = {}}, sizes, margin);
  };
  Eigen::Isometry3d aside = Eigen::Isometry3d::Identity();
  aside.translation().x() = 1;
  const CameraModel other(camera.intrinsics(), aside);
  EXPECT_NO_THROW(with_cameras({camera, other}, 0));
  EXPECT_THROW(with_cameras({camera}, 0), std::invalid_argument);
  EXPECT_THROW(with_cameras({camera, camera}, 0), std::invalid_argument);
  EXPECT_THROW(with_cameras({camera, other}, -1), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
