// SPDX-License-Identifier: Apache-2.0
// The covariance of a lens counts errors that the corners of an image have in common.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <random>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/intrinsics/lens_problem.h"

namespace silhouette {
namespace {

constexpr double kNoise = 0.1;  // pixels per axis
constexpr int kStates = 14;     // two pinhole cameras, and the pose of the second

Eigen::Vector3d NormalVector(std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  return {normal(random), normal(random), normal(random)};
}

Eigen::Isometry3d Motion(const Eigen::Vector3d& turn, const Eigen::Vector3d& shift) {
  Eigen::Isometry3d motion(Eigen::Translation3d{shift});
  motion.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  return motion;
}

// As in truth, without boards.
LensProblem TwoCameras() {
  return {.lens_model = "LENSMODEL_PINHOLE",
          .image_sizes = {{1280, 960}, {1280, 960}},
          .intrinsics = {{900, 900, 640, 480}, {900, 900, 640, 480}},
          .camera_from_reference = {Eigen::Isometry3d::Identity(),
                                    Motion({0, 0.3, 0}, {-0.3, 0.02, 0.05})},
          .reference_from_board = {},
          .lattice = {.width = 6, .height = 5, .spacing = 0.06},
          .observations = {},
          .corners = {}};
}

void AddImage(const Eigen::Isometry3d& reference_from_board, int camera, std::mt19937& random,
              LensProblem& problem) {
  const auto at = static_cast<size_t>(camera);
  std::normal_distribution<double> noise(0, kNoise);
  const auto placing = static_cast<int>(problem.reference_from_board.size()) - 1;
  problem.observations.push_back({.camera = camera, .board = placing});
  for (int row = 0; row < problem.lattice.height; ++row) {
    for (int column = 0; column < problem.lattice.width; ++column) {
      const Eigen::Vector3d point = problem.camera_from_reference[at] * reference_from_board *
                                    (problem.lattice.spacing * Eigen::Vector3d(column, row, 0));
      const auto pixel = ProjectByLens(problem.lens_model, problem.intrinsics[at], point);
      ASSERT_TRUE(pixel.has_value());
      problem.corners.emplace_back(pixel->x() + noise(random), pixel->y() + noise(random),
                                   1 / kNoise);
    }
  }
}

// Ten boards before each camera, and four that tie the cameras: the second camera sees these
// `late` metres beside where the first does.
LensProblem LateCamera(double late, std::mt19937& random) {
  LensProblem problem = TwoCameras();
  for (int i = 0; i < 24; ++i) {
    const Eigen::Isometry3d pose = Motion(0.4 * NormalVector(random), {-0.15, -0.12, 1}) *
                                   Motion({0, 0, 0.01}, 0.05 * NormalVector(random));
    const bool tie = i < 4;
    const int camera = tie ? 0 : i % 2;
    problem.reference_from_board.push_back(
        camera == 0 ? pose : problem.camera_from_reference[1].inverse() * pose);
    AddImage(problem.reference_from_board.back(), camera, random, problem);
    if (!tie) continue;
    const Eigen::Isometry3d moved =
        pose * Motion(Eigen::Vector3d::UnitX() * 1e-9, late * NormalVector(random));
    AddImage(moved, 1, random, problem);
  }
  return problem;
}

Eigen::VectorXd StateOf(const LensProblem& problem) {
  Eigen::VectorXd state(kStates);
  const Eigen::Isometry3d& pose = problem.camera_from_reference[1];
  state << Eigen::Vector4d::Map(problem.intrinsics[0].data()),
      Eigen::Vector4d::Map(problem.intrinsics[1].data()), RotationVectorOf(pose),
      pose.translation();
  return state;
}

TEST(CommonErrors, ALateCameraThatFewFramesTieMakesItAllAsUncertainAsItIs) {
  constexpr int kSessions = 30;
  const FreeParts free{.core = true};
  double squares = 0;
  for (unsigned seed = 1; seed <= kSessions; ++seed) {
    std::mt19937 random(seed);
    LensProblem problem = LateCamera(1e-4, random);
    const Eigen::VectorXd truth = StateOf(problem);
    ASSERT_TRUE(Solve(problem, free).ok());
    const auto found = CovarianceOf(problem, free);
    ASSERT_TRUE(found.ok()) << found.status();
    ASSERT_EQ(found->places.pose[1], 8);
    const Eigen::MatrixXd covariance = found->covariance.topLeftCorner<kStates, kStates>();
    const Eigen::VectorXd error = StateOf(problem) - truth;
    squares += error.dot(covariance.ldlt().solve(error));
  }
  EXPECT_GT(squares / (kSessions * kStates), 0.7);
  EXPECT_LT(squares / (kSessions * kStates), 1.4);
}

}  // namespace
}  // namespace silhouette
