// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/hull_distance.h"

#include <gtest/gtest.h>

#include "calib/robot/triangle_mesh.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr double kFar = 100;

Matrix3Xd Box(const Vector3d& size) {
  const std::vector<Vector3d> corners = BoxMesh(size).vertices;
  Matrix3Xd points(3, static_cast<Eigen::Index>(corners.size()));
  for (size_t i = 0; i < corners.size(); ++i) points.col(static_cast<int>(i)) = corners[i];
  return points;
}

Isometry3d At(const Vector3d& place) { return Isometry3d(Eigen::Translation3d(place)); }

Vector3d RandomVector(Random& random, double most) {
  return {Uniform(random, -most, most), Uniform(random, -most, most), Uniform(random, -most, most)};
}

// Faces that are parallel are where solvers stop too early.
TEST(HullDistance, OfBoxesWithParallelFacesIsExact) {
  Random random;
  for (int i = 0; i < SampleCount(2000); ++i) {
    const Vector3d first(0.3, 0.2, 0.5);
    const Vector3d second(0.05, 0.4, 0.1);
    const Vector3d place = RandomVector(random, 1);
    const Vector3d between = (place.cwiseAbs() - (first + second) / 2).cwiseMax(0);
    const Isometry3d common = RandomPose(random, {0.3, -2, 1});
    const double distance = HullDistance(Box(first), common, Box(second), common * At(place), kFar);
    EXPECT_LE(distance, between.norm() + 1e-12);
    EXPECT_NEAR(distance, between.norm(), 1e-6);
  }
}

TEST(HullDistance, OfTurnedBoxesIsThatOfNoPairOfPointsLess) {
  Random random;
  for (int i = 0; i < SampleCount(300); ++i) {
    const Vector3d size(0.3, 0.2, 0.5);
    const Isometry3d first = RandomPose(random, RandomVector(random, 0.5));
    const Isometry3d second = RandomPose(random, RandomVector(random, 0.5));
    const double distance = HullDistance(Box(size), first, Box(size), second, kFar);
    // From points of the second box, each by turns, to the first: the nearest that this descends
    // to.
    Vector3d nearest = second.translation();
    double descended = kFar;
    for (int step = 0; step < 20'000; ++step) {
      const Vector3d of_first =
          first * Vector3d((first.inverse() * nearest).cwiseMin(size / 2).cwiseMax(-size / 2));
      nearest =
          second * Vector3d((second.inverse() * of_first).cwiseMin(size / 2).cwiseMax(-size / 2));
      descended = (nearest - of_first).norm();
      if (descended - distance < 1e-6) break;
    }
    EXPECT_LE(distance, descended + 1e-12);
    EXPECT_NEAR(distance, descended, 1e-4);
  }
}

TEST(HullDistance, OfPointsAndFlatHullsIsExactToo) {
  const Matrix3Xd point = Vector3d::Zero();
  EXPECT_NEAR(HullDistance(point, At({0, 0, 2}), point, At({0, 0, 0.5}), kFar), 1.5, 1e-6);
  EXPECT_NEAR(HullDistance(point, At({0, 0, 2}), Box({1, 1, 0}), At({0.2, 0, 0}), kFar), 2, 1e-6);
  EXPECT_EQ(HullDistance(point, At({0, 0, 0}), point, At({0, 0, 0}), kFar), 0);
}

TEST(HullDistance, OfHullsInEachOtherIsNone) {
  EXPECT_EQ(HullDistance(Box({1, 1, 1}), At({0, 0, 0}), Box({1, 1, 1}), At({0.9, 0, 0}), kFar), 0);
  EXPECT_EQ(HullDistance(Box({1, 1, 1}), At({0, 0, 0}), Box({0.1, 0.1, 0.1}), At({0, 0, 0}), kFar),
            0);
}

TEST(HullDistance, BeyondWhatIsEnoughIsNotMeasured) {
  const Matrix3Xd box = Box({1, 1, 1});
  EXPECT_EQ(HullDistance(box, At({0, 0, 0}), box, At({3, 0, 0}), 0.5), 0.5);
  EXPECT_NEAR(HullDistance(box, At({0, 0, 0}), box, At({1.4, 0, 0}), 0.5), 0.4, 1e-6);
}

}  // namespace
}  // namespace silhouette
