// SPDX-License-Identifier: Apache-2.0
// Distances of convex bodies from boxes and voxels.
#include "server/collision/space_distances.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

Vector3d Somewhere(const Vector3d& size) {
  return size.array() * (Eigen::Array3d::Random() + 1) / 2.0001;
}

PlacedHull PointAt(const Vector3d& at, double radius = 0) {
  PlacedHull body(Eigen::Matrix3Xd(Vector3d::Zero()), radius);
  body.Place(Eigen::Isometry3d(Eigen::Translation3d(at)));
  return body;
}

// Points about `at`, up to the size of a robot's part: also one, some on a line and some in a
// plane.
Eigen::Matrix3Xd AnyPoints(int round, const Vector3d& at) {
  Eigen::Matrix3Xd points = 0.2 * Eigen::Matrix3Xd::Random(3, 1 + round % 23);
  if (round % 5 == 0) points.row(round % 3).setZero();
  if (round % 7 == 0) points.row((round + 1) % 3).setZero();
  return points.colwise() + at;
}

// By Gilbert's steps, each of which goes from the nearest point so far towards the farthest against
// it. A little above the true distance.
double DistanceByGilbert(const Eigen::Matrix3Xd& points, const AlignedBox3d& box) {
  Vector3d apart = points.col(0) - box.center();
  for (int step = 0; step < 1000; ++step) {
    Eigen::Index nearest = 0;
    (apart.transpose() * points).minCoeff(&nearest);
    const Vector3d corner = (apart.array() > 0).select(box.max(), box.min());
    const Vector3d way = points.col(nearest) - corner - apart;
    if (way.squaredNorm() < 1e-20) break;
    apart += std::clamp(-apart.dot(way) / way.squaredNorm(), 0.0, 1.0) * way;
  }
  return apart.norm();
}

TEST(PlacedHull, DistanceFromABoxIsThatOfItsNearestPoint) {
  int touching = 0;
  for (int round = 0; round < SampleCount(600); ++round) {
    const Eigen::Matrix3Xd points = AnyPoints(round, Somewhere({0.8, 0.8, 0.8}));
    const double radius = round % 3 == 0 ? 0.03 : 0;
    AlignedBox3d box(Somewhere({0.8, 0.8, 0.8}));
    if (round % 4 != 0) box.extend(Vector3d(box.min() + Somewhere({0.3, 0.02, 0.3})));
    // Placed as a link is.
    const Eigen::Isometry3d pose =
        Eigen::Translation3d(Vector3d::Random()) * Eigen::Quaterniond::UnitRandom();
    PlacedHull body(pose.inverse() * points, radius);
    body.Place(pose);
    const double expected = std::max(0.0, DistanceByGilbert(points, box) - radius);
    PlacedHull::Plane plane;
    const double distance = body.Distance(box, 10, plane);
    EXPECT_LE(distance, expected + 1e-9) << "round " << round;
    EXPECT_GE(distance, expected - 2e-3) << "round " << round;
    EXPECT_GE(body.Distance(box, distance / 2, plane), distance / 2);
    if (distance > 0) {
      EXPECT_EQ(plane.DistanceTo(box), distance);
    }
    touching += distance == 0 ? 1 : 0;
  }
  EXPECT_GT(touching, 0);
}

// A box about the origin, grown by a radius.
PlacedHull BoxBody(const Vector3d& half, double radius) {
  Eigen::Matrix3Xd corners(3, 8);
  for (int i = 0; i < 8; ++i) {
    const Vector3d sides((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    corners.col(i) = half.cwiseProduct(sides);
  }
  return {corners, radius};
}

TEST(PlacedHull, DistancesOfBoxesAndBallsAreExactToTheStatedPrecision) {
  Random random;
  for (int round = 0; round < SampleCount(2000); ++round) {
    const Vector3d half = round % 4 == 0 ? Vector3d::Zero() : Vector3d(Somewhere({0.2, 0.2, 0.2}));
    const double radius = std::uniform_real_distribution<double>(0, 0.1)(random);
    const Vector3d at = Somewhere({1, 1, 1});
    AlignedBox3d box(Somewhere({1, 1, 1}));
    box.extend(Vector3d(box.min() + Somewhere({0.3, 0.3, 0.05})));
    PlacedHull body = BoxBody(half, radius);
    body.Place(Eigen::Isometry3d(Eigen::Translation3d(at)));
    const double expected =
        std::max(0.0, AlignedBox3d(at - half, at + half).exteriorDistance(box) - radius);
    PlacedHull::Plane plane;
    const double distance = body.Distance(box, 10, plane);
    EXPECT_LE(distance, expected + 1e-12);
    EXPECT_GE(distance, expected - PlacedHull::kPrecision - 1e-12);
    // A turned one, from a point.
    const Eigen::Isometry3d turned = Eigen::Translation3d(at) * Eigen::Quaterniond::UnitRandom();
    body.Place(turned);
    const double to_point = std::max(
        0.0, AlignedBox3d(-half, half).exteriorDistance(turned.inverse() * box.min()) - radius);
    plane = {};
    const double of_turned = body.Distance(AlignedBox3d(box.min()), 10, plane);
    EXPECT_LE(of_turned, to_point + 1e-12);
    EXPECT_GE(of_turned, to_point - PlacedHull::kPrecision - 1e-12);
  }
}

TEST(PlacedHull, APlaneSaysNoMoreOfAnotherBoxThanItsDistance) {
  for (int round = 0; round < SampleCount(600); ++round) {
    const Eigen::Matrix3Xd points = AnyPoints(round, Somewhere({0.8, 0.8, 0.8}));
    const PlacedHull body(points, 0);
    PlacedHull::Plane plane;
    body.Distance(AlignedBox3d(Somewhere({0.8, 0.8, 0.8})), 10, plane);
    const AlignedBox3d other(Somewhere({0.8, 0.8, 0.8}));
    EXPECT_LE(plane.DistanceTo(other), DistanceByGilbert(points, other) + 1e-9);
  }
}

TEST(SpaceDistances, AreThoseToTheNearestBoxOfAllSets) {
  Random random;
  const VoxelGrid wide({Vector3d::Zero(), Vector3d(3, 2, 2)}, 0.05);
  const VoxelGrid fine({Vector3d(0.53, 0.21, 0.4), Vector3d(1.5, 1.4, 1.6)}, 0.03);
  const auto below = [&](int end) {
    return std::uniform_int_distribution<int>(0, end - 1)(random);
  };
  for (int round = 0; round < SampleCount(40); ++round) {
    VoxelSet far(wide);
    VoxelSet near(fine);
    std::vector<AlignedBox3d> boxes;
    const auto add = [&](const VoxelGrid& grid, VoxelSet& set) {
      const Eigen::Vector3i at(below(grid.size(0)), below(grid.size(1)), below(grid.size(2)));
      set.Insert(at.x(), at.y(), at.z());
      boxes.push_back(grid.Box(at.x(), at.y(), at.z()));
    };
    for (int i = 0; i < 100 * (round % 4); ++i) add(wide, far);
    for (int i = 0; i < 7 * (round % 3); ++i) add(fine, near);
    const double range = std::uniform_real_distribution<double>(0.1, 2)(random);
    const SpaceDistances distances({{far, wide}, {near, fine}}, range);
    for (int i = 0; i < 40; ++i) {
      const Eigen::Matrix3Xd points = AnyPoints(i, Somewhere({3, 2, 2}));
      const PlacedHull body(points, 0);
      if (!wide.box().contains(body.ball_centre())) continue;
      double expected = range;
      for (const auto& box : boxes) {
        PlacedHull::Plane plane;
        expected = std::min(expected, body.Distance(box, expected, plane));
      }
      EXPECT_NEAR(distances.Distance(body, 100), expected, 2 * PlacedHull::kPrecision);
      EXPECT_NEAR(distances.Distance(body, range / 3), std::min(range / 3, expected),
                  2 * PlacedHull::kPrecision);
    }
  }
}

TEST(SpaceDistances, NothingIsKnownBeyondTheGrid) {
  const VoxelGrid grid({Vector3d::Zero(), Vector3d::Ones()}, 0.1);
  const VoxelSet none(grid);
  const SpaceDistances distances({{none, grid}}, 1);
  EXPECT_EQ(distances.Distance(PointAt({0.5, 0.5, 0.5}), 2), 1);
  EXPECT_EQ(distances.Distance(PointAt({0.5, 0.5, -0.01}), 2), 0);
  for (int axis = 0; axis < 3; ++axis) {
    Vector3d nowhere(0.5, 0.5, 0.5);
    nowhere[axis] = std::nan("");
    EXPECT_EQ(distances.Distance(PointAt(nowhere), 2), 0);
  }
}

TEST(SpaceDistances, SomebodyMayBeAnywhereBeyondWhatIsKnown) {
  const VoxelGrid grid({Vector3d::Zero(), Vector3d::Ones()}, 0.1);
  const VoxelSet none(grid);
  const SpaceDistances distances({{none, grid}}, 1,
                                 AlignedBox3d(Vector3d::Zero(), Vector3d(1, 1, 0.9)));
  EXPECT_NEAR(distances.Distance(PointAt({0.5, 0.5, 0.5}), 2), 0.4, 1e-12);
  EXPECT_NEAR(distances.Distance(PointAt({0.5, 0.2, 0.6}), 2), 0.2, 1e-12);
  EXPECT_NEAR(distances.Distance(PointAt({0.5, 0.2, 0.6}, 0.15), 2), 0.05, 1e-12);
  EXPECT_EQ(distances.Distance(PointAt({0.5, 0.5, 0.95}), 2), 0);
}

TEST(SpaceDistances, RangeMayBeAnyNumberOfVoxels) {
  const VoxelGrid grid({Vector3d::Zero(), Vector3d::Ones()}, 0.1);
  const VoxelSet none(grid);
  EXPECT_EQ(SpaceDistances({{none, grid}}, 50).Distance(PointAt({0.5, 0.5, 0.5}), 100), 50);
}

TEST(SpaceDistances, RefusesARangeThatCannotBe) {
  const VoxelGrid grid({Vector3d::Zero(), Vector3d::Ones()}, 0.1);
  const VoxelSet none(grid);
  for (double range : {0.0, -1.0, std::nan("")}) {
    EXPECT_THROW(SpaceDistances({{none, grid}}, range), std::invalid_argument);
  }
  const VoxelSet other;
  EXPECT_THROW(SpaceDistances({{other, grid}}, 1), std::invalid_argument);
  EXPECT_THROW(SpaceDistances({}, 1), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
