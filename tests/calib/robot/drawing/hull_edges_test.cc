// SPDX-License-Identifier: Apache-2.0
// The edges that bound what an eye sees, against the hull of the image of all points.
#include "calib/robot/drawing/hull_edges.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "calib/robot/drawing/convex_outline.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;

Vector3d RandomPlace(Random& random) {
  return {Uniform(random, -1, 1), Uniform(random, -1, 1), Uniform(random, -1, 1)};
}

// Round bodies, boxes, points in a plane or on a line, many on one face or edge, some twice.
Matrix3Xd RandomPoints(Random& random) {
  const auto count = static_cast<Eigen::Index>(1 + random() % 60);
  Matrix3Xd points(3, count);
  const auto kind = random() % 6;
  const Vector3d size = Vector3d::Constant(0.02) + RandomPlace(random).cwiseAbs();
  for (Eigen::Index i = 0; i < count; ++i) {
    Vector3d p = RandomPlace(random);
    if (kind == 0) p.normalize();
    if (kind == 1) p = (2 * p).array().round() / 2;  // on a lattice
    if (kind == 2) p.z() = std::copysign(1, p.z());
    if (kind == 3) p.z() = 0.3;
    if (kind == 4) p = p.x() * Vector3d(1, 0.5, -0.3);
    if (kind == 5) {
      const double angle =
          2 * std::numbers::pi * static_cast<double>(i / 2) / static_cast<double>((count + 1) / 2);
      p = {std::cos(angle), std::sin(angle), i % 2 == 0 ? 0.5 : -0.5};
    }
    points.col(i) = p.cwiseProduct(size);
  }
  if (random() % 2 == 0) return points;
  // Turned, and as files of single precision or with errors of rounding have them.
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(Uniform(random, -3, 3), RandomPlace(random).normalized())
          .toRotationMatrix();
  points = (turn * points).eval();
  if (random() % 2 == 0) return points.cast<float>().cast<double>();
  const double error = std::pow(10, Uniform(random, -17, -6));
  for (auto point : points.colwise()) point += error * RandomPlace(random);
  return points;
}

// Outside the hull of points in a ball; now and then in, or nearly in, the plane of three of them.
Vector3d RandomEye(Random& random, const Matrix3Xd& points) {
  const Vector3d middle = points.rowwise().mean();
  const double round = (points.colwise() - middle).colwise().norm().maxCoeff();
  const double distance = 0.1 + (1.05 + Uniform(random, 0, 3)) * round;
  const Vector3d eye = middle + distance * RandomPlace(random).normalized();
  if (random() % 2 == 0) return eye;
  const auto any = [&]() -> Vector3d {
    return points.col(static_cast<Eigen::Index>(random() % static_cast<size_t>(points.cols())));
  };
  const Vector3d on = any();
  const Vector3d normal = (any() - on).cross(any() - on);
  if (!(normal.norm() > 1e-6)) return eye;
  const Vector3d in_plane = eye - normal.normalized() * normal.normalized().dot(eye - on);
  if ((in_plane - middle).norm() < 1.05 * round + 0.05) return eye;
  const double off = random() % 2 == 0 ? 0 : std::pow(10, Uniform(random, -10, -5));
  return in_plane + off * normal.normalized();
}

// What is between the ends of a line at a height.
struct Span {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void Add(const Vector2d& a, const Vector2d& b, double y) {
    if (std::min(a.y(), b.y()) > y || std::max(a.y(), b.y()) < y) return;
    const double share = a.y() == b.y() ? 0 : (y - a.y()) / (b.y() - a.y());
    const double x = a.x() + share * (b.x() - a.x());
    low = std::min(low, x);
    high = std::max(high, x);
  }
};

TEST(HullEdges, OutlineIsThatOfTheWholeHullFromEveryEye) {
  Random random;
  size_t rows = 0;
  for (int trial = 0; trial < SampleCount(4000); ++trial) {
    const Matrix3Xd points = RandomPoints(random);
    const HullEdges edges(points);
    const Vector3d middle = points.rowwise().mean();
    const Vector3d eye = RandomEye(random, points);
    Eigen::Matrix3d turn;
    turn.row(2) = (middle - eye).normalized();
    turn.row(0) = turn.row(2).unitOrthogonal();
    turn.row(1) = turn.row(2).cross(turn.row(0));
    std::vector<Vector2d> seen;
    for (const auto& point : points.colwise()) {
      const Vector3d at = turn * (point - eye);
      seen.emplace_back(at.head<2>() / at.z());
    }
    std::vector<Vector2d> sorted = seen;
    std::vector<Vector2d> hull;
    ConvexHull(sorted, hull);
    if (hull.size() < 2) continue;
    for (int row = 0; row < 20; ++row) {
      const double y = Uniform(random, seen[0].y() - 0.3, seen[0].y() + 0.3);
      Span whole;
      for (size_t i = 0; i < hull.size(); ++i) whole.Add(hull[i], hull[(i + 1) % hull.size()], y);
      Span outline;
      edges.ForOutline(eye, [&](uint32_t a, uint32_t b) { outline.Add(seen[a], seen[b], y); });
      // Near the uppermost and the lowest point a little up is far aside.
      const auto [top, bottom] =
          std::ranges::minmax(hull, {}, [](const Vector2d& p) { return p.y(); });
      if (y - top.y() < 1e-4 || bottom.y() - y < 1e-4) continue;
      ++rows;
      ASSERT_NEAR(outline.low, whole.low, 1e-6) << "trial " << trial;
      ASSERT_NEAR(outline.high, whole.high, 1e-6) << "trial " << trial;
    }
  }
  EXPECT_GT(rows, static_cast<size_t>(SampleCount(8000)));
}

TEST(HullEdges, BoxHasTwelveEdgesAndShowsFourOrSixOfThem) {
  Matrix3Xd box(3, 8);
  for (int i = 0; i < 8; ++i) box.col(i) = Vector3d(i % 2, i / 2 % 2, i / 4);
  const HullEdges edges(box);
  EXPECT_EQ(edges.size(), 12u);
  const auto shown = [&](const Vector3d& eye) {
    int count = 0;
    edges.ForOutline(eye, [&](uint32_t, uint32_t) { ++count; });
    return count;
  };
  EXPECT_EQ(shown({0.5, 0.5, 3}), 4);
  EXPECT_EQ(shown({3, 4, 5}), 6);
}

TEST(HullEdges, BallOfThePointsDepthIsInTheHull) {
  Random random;
  int deep = 0;
  for (int trial = 0; trial < SampleCount(400); ++trial) {
    const Matrix3Xd points = RandomPoints(random);
    const HullEdges edges(points);
    // Between some of the points, or anywhere.
    Vector3d at = 1.2 * RandomPlace(random);
    if (trial % 4 != 0) {
      Eigen::VectorXd shares(points.cols());
      for (double& share : shares) share = std::pow(Uniform(random, 0, 1), trial % 4);
      at = points * shares / shares.sum();
    }
    const double depth = edges.DepthOf(at);
    ASSERT_GE(depth, 0);
    if (depth == 0) continue;
    ++deep;
    for (int i = 0; i < 500; ++i) {
      const Vector3d along = RandomPlace(random).normalized();
      ASSERT_LE(along.dot(at) + depth, (along.transpose() * points).maxCoeff())
          << "trial " << trial;
    }
  }
  EXPECT_GT(deep, SampleCount(100));
}

TEST(HullEdges, DepthInABoxIsThatToTheNearestFace) {
  Matrix3Xd box(3, 8);
  for (int i = 0; i < 8; ++i) box.col(i) = Vector3d(i % 2, i / 2 % 2, i / 4);
  const HullEdges edges(box);
  EXPECT_NEAR(edges.DepthOf({0.5, 0.5, 0.5}), 0.5, 2e-6);
  EXPECT_NEAR(edges.DepthOf({0.5, 0.1, 0.7}), 0.1, 2e-6);
  EXPECT_EQ(edges.DepthOf({0.5, -0.1, 0.7}), 0);
  EXPECT_EQ(HullEdges(box.leftCols(4)).DepthOf({0.5, 0.5, 0}), 0);  // a plate
  EXPECT_EQ(HullEdges(box.leftCols(1)).DepthOf({0, 0, 0}), 0);
}

TEST(HullEdges, NothingIsKnownOfAPointOrOfTooManyPoints) {
  EXPECT_TRUE(HullEdges(Matrix3Xd::Zero(3, 1)).empty());
  EXPECT_TRUE(HullEdges(Matrix3Xd::Random(3, HullEdges::kMostPoints + 1)).empty());
}

}  // namespace
}  // namespace silhouette
