// SPDX-License-Identifier: Apache-2.0
// The covariance of a lens knows of the errors that all images of a camera share.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <random>
#include <string>
#include <vector>

#include "calib/camera/common_field.h"
#include "calib/intrinsics/lens_problem.h"
#include "tests/calib/intrinsics/synthetic_boards.h"

namespace silhouette {
namespace {

constexpr int kShifts = 2 * kFieldKnots;

// One camera held fixed, its board's motion, then the shifts of two cameras' fields.
LensCovariance OnlyFields() {
  LensCovariance covariance;
  covariance.covariance = Eigen::MatrixXd::Identity(6 + 2 * kShifts, 6 + 2 * kShifts);
  covariance.places = {.intrinsics = {-1, -1}, .pose = {-1, -1}, .field = 6};
  covariance.image_sizes = {{640, 480}, {640, 480}};
  return covariance;
}

TEST(FieldCovariance, AProjectionMovesAgainstTheShiftsOfTheKnotsAroundIt) {
  const LensCovariance covariance = OnlyFields();
  const Eigen::Vector3d point(0.1, -0.05, 1);
  const std::vector<double> lens = {600, 600, 319.5, 239.5};
  const auto derivative = DerivativeOfProjection(covariance, 1, "LENSMODEL_PINHOLE", lens,
                                                 Eigen::Isometry3d::Identity(), point);
  ASSERT_TRUE(derivative.has_value());
  ASSERT_EQ(derivative->cols(), 6 + 2 * kShifts);
  EXPECT_TRUE(derivative->middleCols<kShifts>(6).isZero()) << "another camera's";
  Eigen::Matrix<double, 2, Eigen::Dynamic> expected(2, kShifts);
  expected.setZero();
  for (const KnotShare& knot : KnotsAt({379.5, 209.5}, 640, 480)) {
    expected(0, 2 * knot.knot) -= knot.share;
    expected(1, 2 * knot.knot + 1) -= knot.share;
  }
  EXPECT_TRUE(derivative->rightCols<kShifts>().isApprox(expected, 1e-9));
}

// A lens whose sixth-order term the model lacks, beside one that has it.
TEST(FieldCovariance, ALensWhoseModelLacksATermHasAFieldAndIsLessCertain) {
  std::mt19937 random(3);
  CameraIntrinsics intrinsics = CamerasOnAnArc(1)[0].intrinsics();
  intrinsics.distortion[4] = -0.1;
  const std::vector<CameraModel> cameras = {
      CameraModel(intrinsics, CamerasOnAnArc(1)[0].camera_from_world())};
  const Board board = LatticeBoard();
  const std::vector<TagSighting> sightings =
      SightingsOf(cameras, board, {.frames = 40, .noise = 0.05}, random);
  const auto covariance = [&](const std::string& model) {
    const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, sightings,
                                      {.lens_model = model, .least_known = 0});
    EXPECT_TRUE(solution.ok()) << model << ": " << solution.status();
    return solution.ok() ? solution->groups.at(0).covariance : LensCovariance{};
  };
  const LensCovariance whole = covariance("LENSMODEL_OPENCV5");
  EXPECT_EQ(whole.places.field, -1);
  const LensCovariance lacking = covariance("LENSMODEL_OPENCV4");
  ASSERT_GE(lacking.places.field, 0);
  ASSERT_EQ(lacking.covariance.rows(), lacking.places.field + kShifts);
  const Eigen::MatrixXd shifts = lacking.covariance.bottomRightCorner(kShifts, kShifts);
  EXPECT_GT(shifts(0, 0), 0);
  EXPECT_TRUE(shifts.isApprox(shifts(0, 0) * Eigen::MatrixXd::Identity(kShifts, kShifts), 1e-9));
  EXPECT_GT(lacking.covariance(0, 0), 2 * whole.covariance(0, 0)) << "the focal length";
  const Eigen::VectorXd scale = lacking.covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * lacking.covariance * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled, Eigen::EigenvaluesOnly);
  EXPECT_GT(solver.eigenvalues().minCoeff(), -1e-6) << "what a covariance cannot have";
}

TEST(FieldCovariance, WhatNoImageDeterminesIsRefused) {
  LensProblem problem{.lens_model = "LENSMODEL_PINHOLE",
                      .image_sizes = {{640, 480}},
                      .intrinsics = {{600, 600, 319.5, 239.5}},
                      .camera_from_reference = {Eigen::Isometry3d::Identity()},
                      .reference_from_board = {Eigen::Isometry3d(Eigen::Translation3d(0, 0, 1))},
                      .lattice = {.width = 5, .height = 4, .spacing = 0.03},
                      .observations = {{}},
                      .corners = {}};
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 5; ++column) {
      problem.corners.emplace_back(600 * 0.03 * column + 319.5, 600 * 0.03 * row + 239.5, 10);
    }
  }
  // A board that faces the camera does not tell focal length from distance.
  const auto covariance = CovarianceOf(problem, {.core = true});
  EXPECT_THAT(std::string(covariance.status().message()),
              testing::HasSubstr("some of the lenses or poses undetermined"));
}

}  // namespace
}  // namespace silhouette
