// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/inner_balls.h"

#include <gtest/gtest.h>

#include "tests/random.h"

namespace silhouette::cell_experiment {
namespace {

Obstacle BoxOf(const Eigen::Vector3d& size) {
  Obstacle box;
  box.mesh = BoxMesh(size);
  box.world_from_obstacle = Eigen::Translation3d(1, 2, 3) *
                            Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized());
  return box;
}

TEST(BallsWithin, TheyHoldThePointAndLieInTheObstacle) {
  Random random;
  const Eigen::Vector3d size(0.4, 0.5, 1.2);
  const Obstacle box = BoxOf(size);
  constexpr double kRadius = 0.1;
  int none = 0;
  int some = 0;
  for (int i = 0; i < 500; ++i) {
    Eigen::Vector3d at;
    for (int axis = 0; axis < 3; ++axis) {
      at[axis] = std::uniform_real_distribution<double>(-0.5, 0.5)(random) * size[axis];
    }
    const Eigen::Vector3d point = box.world_from_obstacle * at;
    const std::vector<Eigen::Vector3d> centres = BallsWithin(box, point, kRadius);
    // The centres that can be are those of a smaller box.
    const Eigen::Vector3d half = size / 2 - Eigen::Vector3d::Constant(kRadius);
    const double away = Eigen::AlignedBox3d(-half, half).exteriorDistance(at);
    if (std::abs(away - kRadius) > 1e-3) {
      EXPECT_EQ(centres.empty(), away > kRadius);
    }
    (centres.empty() ? none : some) += 1;
    for (const Eigen::Vector3d& centre : centres) {
      EXPECT_LE((centre - point).norm(), kRadius + 1e-9);
      for (const Eigen::Vector3d& of_ball : PointsOfBall(centre, kRadius)) {
        const Eigen::Vector3d in_box = box.world_from_obstacle.inverse() * of_ball;
        EXPECT_LE(((in_box.cwiseAbs() - size / 2).maxCoeff()), 6e-4);
      }
    }
  }
  EXPECT_GT(none, 5);
  EXPECT_GT(some, 300);
}

TEST(BallsWithin, NothingThinnerHoldsOne) {
  const Obstacle thin = BoxOf({0.19, 1, 1});
  EXPECT_TRUE(BallsWithin(thin, thin.world_from_obstacle.translation(), 0.1).empty());
  Obstacle ball;
  ball.mesh = SphereMesh(0.12);
  EXPECT_TRUE(BallsWithin(ball, {0, 0, 0.05}, 0.16).empty());
  EXPECT_FALSE(BallsWithin(ball, {0, 0, 0.05}, 0.11).empty());
  EXPECT_FALSE(BallsWithin(ball, {0, 0, 0.115}, 0.11).empty());
}

}  // namespace
}  // namespace silhouette::cell_experiment
