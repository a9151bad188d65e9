// SPDX-License-Identifier: Apache-2.0
// Where a robot's body certainly is: never more than there is of it.
#include "calib/robot/robot_body.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <stdexcept>

#include "calib/robot/distance_field.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/random.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;

constexpr double kStep = 0.01;
constexpr double kRange = 0.15;

TriangleMesh Moved(TriangleMesh mesh, const Vector3d& by) {
  for (Vector3d& vertex : mesh.vertices) vertex += by;
  return mesh;
}

// Of a box with its middle at the origin.
double DistanceOfBox(const Vector3d& size, const Vector3d& point) {
  const Vector3d beyond = point.cwiseAbs() - size / 2;
  return beyond.cwiseMax(0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

Vector3d RandomPoint(std::mt19937& random, double reach) {
  return {Uniform(random, -reach, reach), Uniform(random, -reach, reach),
          Uniform(random, -reach, reach)};
}

TEST(DistanceField, BoundsTheDistanceFromBothSides) {
  const Vector3d size(0.3, 0.2, 0.1);
  const DistanceField field(std::vector{BoxMesh(size)}, kRange, kStep);
  std::mt19937 random(7);
  int inside = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vector3d point = RandomPoint(random, 0.3);
    const double distance = DistanceOfBox(size, point);
    ASSERT_GE(field.AtMost(point), distance - 1e-9) << "seed 7, " << point.transpose();
    ASSERT_LE(field.AtLeast(point), std::max(distance, 0.0) + 1e-9) << point.transpose();
    if (distance < kRange) {
      ASSERT_LE(field.AtMost(point), distance + 2 * kStep) << point.transpose();
      ASSERT_GE(field.AtLeast(point), std::min(distance, 0.0) - 2 * kStep) << point.transpose();
      ASSERT_TRUE(distance <= 0 || field.AtLeast(point) >= distance - 2 * kStep);
    }
    if (field.AtMost(point) < 0) ++inside;
  }
  EXPECT_GT(inside, 300);
}

TEST(DistanceField, OfACylinderAgreesWithItsAxis) {
  const double radius = 0.1;
  const DistanceField field(std::vector{CylinderMesh(radius, 0.4)}, kRange, kStep);
  const double flat = radius * (1 - std::cos(std::numbers::pi / kCircleCorners));
  for (double away = 0; away < 0.2; away += 0.003) {
    const double distance = field.AtMost({0.6 * away, 0.8 * away, 0.03});
    EXPECT_GE(distance, away - radius - 1e-9);
    EXPECT_LE(distance, away - radius + flat + 2 * kStep);
  }
}

TEST(DistanceField, BodiesThatOverlapAreOne) {
  const Vector3d size(0.2, 0.2, 0.2);
  const std::vector meshes = {Moved(BoxMesh(size), {-0.08, 0, 0}),
                              Moved(BoxMesh(size), {0.08, 0, 0})};
  const DistanceField field(meshes, kRange, kStep);
  EXPECT_LT(field.AtMost({0, 0, 0}), 0);
  EXPECT_LT(field.AtMost({-0.15, 0.05, 0.05}), 0);
  EXPECT_LT(field.AtMost({0.15, 0.05, 0.05}), 0);
  EXPECT_GT(field.AtMost({0, 0.101, 0}), 0);
}

TEST(DistanceField, HollowIsOutside) {
  TriangleMesh shell = BoxMesh({0.4, 0.4, 0.4});
  TriangleMesh hollow = BoxMesh({0.2, 0.2, 0.2});
  const auto first = static_cast<uint32_t>(shell.vertices.size());
  shell.vertices.insert(shell.vertices.end(), hollow.vertices.begin(), hollow.vertices.end());
  for (auto triangle : hollow.triangles) {
    std::swap(triangle[0], triangle[1]);
    for (uint32_t& vertex : triangle) vertex += first;
    shell.triangles.push_back(triangle);
  }
  const DistanceField field(std::vector{shell}, kRange, kStep);
  EXPECT_GT(field.AtMost({0, 0, 0}), 0.09);
  EXPECT_LT(field.AtMost({0.15, 0, 0}), 0);
}

TEST(DistanceField, MeshThatIsTurnedInsideOutIsTheSameBody) {
  TriangleMesh mesh = BoxMesh({0.2, 0.2, 0.2});
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  const DistanceField field(std::vector{mesh}, kRange, kStep);
  EXPECT_LT(field.AtMost({0, 0, 0}), -0.07);
  EXPECT_GT(field.AtMost({0.15, 0, 0}), 0);
}

TEST(DistanceField, MeshWithAHoleIsNotClosed) {
  TriangleMesh mesh = SphereMesh(0.1);
  EXPECT_TRUE(IsClosed(mesh));
  // As STL has it: no vertex is shared.
  TriangleMesh soup;
  for (const auto& triangle : mesh.triangles) {
    const auto at = static_cast<uint32_t>(soup.vertices.size());
    for (uint32_t vertex : triangle) soup.vertices.push_back(mesh.vertices[vertex]);
    soup.triangles.push_back({at, at + 1, at + 2});
  }
  EXPECT_TRUE(IsClosed(soup));
  soup.triangles.pop_back();
  EXPECT_FALSE(IsClosed(soup));
  EXPECT_THROW(DistanceField(std::vector{soup}, kRange, kStep), std::invalid_argument);
  EXPECT_FALSE(IsClosed({}));
  // A sheet that is seen from both sides encloses nothing, flat or as an open box.
  for (const size_t triangles : {1u, 2u, 10u}) {
    TriangleMesh sheet = BoxMesh({1, 2, 3});
    sheet.triangles.resize(triangles);
    for (size_t i = 0; i < triangles; ++i) {
      const auto [a, b, c] = sheet.triangles[i];
      sheet.triangles.push_back({b, a, c});
    }
    EXPECT_FALSE(IsClosed(sheet));
  }
}

TEST(DistanceField, NumbersThatCannotBeAreRefused) {
  const std::vector meshes = {SphereMesh(0.1)};
  EXPECT_THROW(DistanceField(meshes, 0, kStep), std::invalid_argument);
  EXPECT_THROW(DistanceField(meshes, kRange, 0), std::invalid_argument);
  EXPECT_THROW(DistanceField({}, kRange, kStep), std::invalid_argument);
}

double AtMost(const PosedBody& body, const Vector3d& point) {
  size_t hint = 0;
  return body.AtMost(point, hint);
}

class RobotBodyTest : public testing::Test {
 protected:
  static RobotModel Read(const std::string& urdf) {
    return RobotModel::FromUrdf(WriteFile(TestFolder() / "robot.urdf", urdf)).value();
  }

  // An arm of three boxes, of which the outermost slides.
  static RobotModel Three() {
    return Read(R"(<robot name="three">
    <link name="foot"><visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual></link>
    <link name="upper">
      <visual><origin xyz="0.3 0 0"/><geometry><box size="0.6 0.1 0.1"/></geometry></visual>
    </link>
    <link name="lower">
      <visual><origin xyz="0.2 0 0.1"/><geometry><box size="0.4 0.06 0.2"/></geometry></visual>
    </link>
    <link name="slide">
      <visual><origin xyz="0 0.1 0"/><geometry><box size="0.1 0.3 0.1"/></geometry></visual>
    </link>
    <joint name="turn" type="revolute">
      <parent link="foot"/><child link="upper"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
      <limit lower="-3" upper="3" effort="1" velocity="1"/>
    </joint>
    <joint name="bend" type="revolute">
      <parent link="upper"/><child link="lower"/><origin xyz="0.6 0 0"/><axis xyz="0 1 0"/>
      <limit lower="-3" upper="3" effort="1" velocity="1"/>
    </joint>
    <joint name="push" type="prismatic">
      <parent link="lower"/><child link="slide"/><origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/>
    </joint></robot>)");
  }
  // Of the boxes of Three() with the joints there.
  static double DistanceOfThree(const RobotModel& robot, const std::vector<double>& q,
                                const Vector3d& point) {
    const std::vector<Eigen::Isometry3d> poses = robot.LinkPoses(q);
    const auto of_box = [&](size_t link, const Vector3d& middle, const Vector3d& size) {
      return DistanceOfBox(size, poses[link].inverse() * point - middle);
    };
    return std::min({of_box(0, {0, 0, 0}, {0.2, 0.2, 0.2}), of_box(1, {0.3, 0, 0}, {0.6, 0.1, 0.1}),
                     of_box(2, {0.2, 0, 0.1}, {0.4, 0.06, 0.2}),
                     of_box(3, {0, 0.1, 0}, {0.1, 0.3, 0.1})});
  }

  // A box on the floor and an arm that turns about z, one metre above it.
  const RobotModel robot_ = Read(R"(<robot name="two">
    <link name="foot">
      <visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual>
      <collision><geometry><box size="2 2 2"/></geometry></collision>
    </link>
    <link name="arm">
      <visual><origin xyz="0.3 0 0"/><geometry><box size="0.6 0.1 0.1"/></geometry></visual>
    </link>
    <joint name="turn" type="revolute">
      <parent link="foot"/><child link="arm"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
      <limit lower="-3" upper="3" effort="1" velocity="1"/>
    </joint></robot>)");
};

TEST_F(RobotBodyTest, FollowsTheJoints) {
  const RobotBody body(robot_, {.range = kRange, .step = kStep});
  EXPECT_TRUE(body.open_links().empty());
  const Vector3d ahead(0.5, 0, 1);
  const Vector3d aside(0, 0.5, 1);
  const double quarter = std::numbers::pi / 2;
  EXPECT_LT(AtMost(body.At(std::vector{0.0}), ahead), 0);
  EXPECT_GT(AtMost(body.At(std::vector{0.0}), aside), 0);
  EXPECT_LT(AtMost(body.At(std::vector{quarter}), aside), 0);
  EXPECT_GT(AtMost(body.At(std::vector{quarter}), ahead), 0);
  EXPECT_LT(AtMost(body.At(std::vector{quarter}), {0, 0, 0}), 0);
  EXPECT_THROW(body.At(std::vector<double>{}), std::invalid_argument);
}

TEST_F(RobotBodyTest, CountsWhatTheRobotLooksLikeNotItsEnvelope) {
  const RobotBody body(robot_, {.range = kRange, .step = kStep});
  EXPECT_GT(AtMost(body.At(std::vector{0.0}), {0.5, 0.5, 0.5}), 0);
}

TEST_F(RobotBodyTest, IsNeverMoreThanTheModelLessItsTolerance) {
  const double tolerance = 0.02;
  const RobotBody body(robot_, {.tolerance = tolerance, .range = kRange, .step = kStep});
  std::mt19937 random(11);
  for (const double turn : {0.0, 0.7, -2.1}) {
    const PosedBody posed = body.At(std::vector{turn});
    const Eigen::AngleAxisd back(-turn, Vector3d::UnitZ());
    for (int i = 0; i < 5000; ++i) {
      const Vector3d point = Vector3d(0, 0, 0.5) + RandomPoint(random, 0.8);
      const Vector3d in_arm = back * (point - Vector3d(0, 0, 1)) - Vector3d(0.3, 0, 0);
      const double distance =
          std::min(DistanceOfBox({0.2, 0.2, 0.2}, point), DistanceOfBox({0.6, 0.1, 0.1}, in_arm));
      ASSERT_GE(AtMost(posed, point), distance + tolerance - 1e-9)
          << "seed 11, " << point.transpose();
      if (distance < 0.1) {
        ASSERT_LE(AtMost(posed, point), distance + tolerance + 2 * kStep);
      }
      ASSERT_TRUE(posed.MayReach(point, std::max(distance, 0.0) - tolerance + 1e-9))
          << point.transpose();
      ASSERT_FALSE(distance > 0.1 && posed.MayReach(point, distance - tolerance - 0.1));
    }
  }
}

TEST_F(RobotBodyTest, MayReachAsFarAsItsPayload) {
  const PosedBody bare = RobotBody(robot_, {.range = kRange, .step = kStep}).At(std::vector{0.0});
  const RobotBody laden(robot_, {.payload_radius = 0.3, .range = kRange, .step = kStep});
  const Vector3d beyond_arm(0.85, 0, 1);
  const Vector3d beside_foot(0.35, 0, 0);
  EXPECT_FALSE(bare.MayReach(beyond_arm, 0));
  EXPECT_TRUE(laden.At(std::vector{0.0}).MayReach(beyond_arm, 0));
  EXPECT_FALSE(laden.At(std::vector{0.0}).MayReach(beside_foot, 0)) << "the foot carries nothing";
}

TEST_F(RobotBodyTest, RoundShapesMayBeReachedAllOverTheirTrueSurface) {
  const RobotModel robot = Read(R"(<robot name="round">
    <link name="disc"><visual><geometry><cylinder radius="1" length="0.02"/></geometry></visual></link>
    <link name="ball"><visual><geometry><sphere radius="0.5"/></geometry></visual></link>
    <joint name="weld" type="fixed">
      <parent link="disc"/><child link="ball"/><origin xyz="0 0 2"/>
    </joint></robot>)");
  const RobotBody body(robot, {.range = 0.02, .step = 0.02});
  const PosedBody posed = body.At({});
  Random random;
  for (int i = 0; i < 3000; ++i) {
    // In the middle of an edge of the polygon the circle is the farthest outside.
    const double angle = (i % kCircleCorners + 0.5) * 2 * std::numbers::pi / kCircleCorners;
    const Vector3d out(std::cos(angle), std::sin(angle), 0);
    EXPECT_TRUE(posed.MayReach(out + Uniform(random, -0.01, 0.01) * Vector3d::UnitZ(), 1e-9));
    EXPECT_TRUE(posed.MayReach(Vector3d(0, 0, 2) + 0.5 * RandomDirection(random), 1e-9));
  }
  EXPECT_FALSE(posed.MayReach({1.05, 0, 0}, 0.01));
  EXPECT_FALSE(posed.MayReach({0, 0, 2.55}, 0.01));
}

TEST_F(RobotBodyTest, LinksThatStandStillHaveNotMoved) {
  const RobotBody body(robot_, {.range = kRange, .step = kStep});
  const PosedBody moved = body.At(std::vector{0.5}).MovedFrom(body.At(std::vector{0.0}));
  EXPECT_FALSE(moved.MayReach({0, 0, 0}, 0)) << "the foot";
  EXPECT_TRUE(moved.MayReach({0.3 * std::cos(0.5), 0.3 * std::sin(0.5), 1}, 0)) << "the arm";
}

TEST_F(RobotBodyTest, WhatIsInsideIsSoWhereverTheJointsAreInTheirRanges) {
  const RobotModel robot = Three();
  const RobotBody body(robot, {.range = kRange, .step = kStep});
  Random random;
  std::uniform_real_distribution<double> share(-1, 1);
  int inside = 0;
  for (int i = 0; i < SampleCount(40); ++i) {
    std::vector<double> middle;
    std::vector<double> half;
    for (int joint = 0; joint < 3; ++joint) {
      middle.push_back(share(random));
      half.push_back(0.02 * std::abs(share(random)));
    }
    const PosedBody posed = body.At(middle, half);
    for (int j = 0; j < 500; ++j) {
      const Vector3d point =
          Vector3d(0.6, 0, 1) + 0.6 * Vector3d(share(random), share(random), share(random));
      const double most = AtMost(posed, point);
      std::vector<double> q = middle;
      for (size_t joint = 0; joint < 3; ++joint) q[joint] += half[joint] * share(random);
      ASSERT_GE(most, DistanceOfThree(robot, q, point) - 1e-9) << point.transpose();
      inside += most < 0 ? 1 : 0;
    }
  }
  EXPECT_GT(inside, SampleCount(20));
}

TEST_F(RobotBodyTest, BetweenJointValuesHoldsTheBodyAtEachOfThem) {
  const RobotModel robot = Three();
  const RobotBody body(robot, {.payload_radius = 0.15, .range = kRange, .step = kStep});
  Random random;
  std::uniform_real_distribution<double> share(0, 1);
  int far_away = 0;
  for (int i = 0; i < 60; ++i) {
    std::vector<double> lower, upper;
    for (const double widest : {0.5, 0.8, 0.3}) {
      lower.push_back(2 * share(random) - 1);
      upper.push_back(lower.back() + (share(random) < 0.3 ? 0 : widest * share(random)));
    }
    const PosedBody between = body.Between(lower, upper, i % 2 == 0 ? 0.02 : 1);
    for (int j = 0; j < 100; ++j) {
      std::vector<double> q;
      for (size_t k = 0; k < 3; ++k) {
        q.push_back(lower[k] + share(random) * (upper[k] - lower[k]));
      }
      const std::vector<Eigen::Isometry3d> poses = robot.LinkPoses(q);
      const Vector3d corner(share(random) < 0.5 ? 0 : 1, share(random) < 0.5 ? 0 : 1,
                            share(random) < 0.5 ? 0 : 1);
      const Vector3d at = corner - Vector3d(0.5, 0.5, 0.5);
      const std::vector<Vector3d> points = {
          poses[1] * (Vector3d(0.3, 0, 0) + at.cwiseProduct(Vector3d(0.6, 0.1, 0.1))),
          poses[2] * (Vector3d(0.2, 0, 0.1) + at.cwiseProduct(Vector3d(0.4, 0.06, 0.2))),
          poses[3] * (Vector3d(0, 0.1, 0) + at.cwiseProduct(Vector3d(0.1, 0.3, 0.1))),
          poses[3].translation() + 0.15 * (poses[3].linear() * at.normalized())};
      for (const Vector3d& point : points) {
        ASSERT_TRUE(between.MayReach(point, 1e-6)) << "range " << i << ", " << point.transpose();
      }
    }
    if (!between.MayReach({-0.5, 0, 1}, 0.1)) ++far_away;
  }
  EXPECT_GT(far_away, 40) << "it is not everything";
}

TEST_F(RobotBodyTest, BetweenJointValuesHoldsWhatMimics) {
  const RobotModel robot = Gripper();
  const RobotBody body(robot, {.range = kRange, .step = kStep});
  Random random;
  for (int i = 0; i < 40; ++i) {
    std::vector<double> lower, upper;
    for (size_t j = 0; j < robot.joints().size(); ++j) {
      lower.push_back(Uniform(random, -0.1, 0.3));
      upper.push_back(lower.back() + (j + 1 < robot.joints().size() ? 0 : 0.1));
    }
    const PosedBody between = body.Between(lower, upper, i % 2 == 0 ? 0.01 : 1);
    const PosedBody moved = between.MovedFrom(body.At(lower));
    for (int j = 0; j < 50; ++j) {
      std::vector<double> q = lower;
      q.back() = Uniform(random, lower.back(), upper.back());
      const auto poses = robot.LinkPoses(q);
      for (size_t link = 1; link < poses.size(); ++link) {
        const LinkGeometry& geometry = robot.links()[link].visual[0];
        const Vector3d point = poses[link] * geometry.link_from_shape *
                               SurfacePoint(random, Tessellate(geometry.shape));
        ASSERT_TRUE(between.MayReach(point, 1e-6)) << robot.links()[link].name;
        ASSERT_TRUE(link < 8 || moved.MayReach(point, 1e-6)) << robot.links()[link].name;
      }
    }
  }
}

TEST_F(RobotBodyTest, BallsAreMetOnlyIfALinkMovesTowardsThem) {
  constexpr double kRadius = 0.1;
  const RobotModel robot = Three();
  const RobotBody body(robot, {.tolerance = 0.005, .range = kRange, .step = kStep});
  Random random;
  std::uniform_real_distribution<double> share(-1, 1);
  int met = 0;
  int not_met = 0;
  for (int i = 0; i < 200; ++i) {
    std::vector<double> from, to;
    for (const double widest : {0.15, 0.2, 0.1}) {
      from.push_back(share(random));
      to.push_back(from.back() + (share(random) < -0.2 ? 0 : widest * share(random)));
    }
    const PosedBody way = body.Between(from, to, 0.005);
    for (int balls = 0; balls < 20;) {
      const Vector3d centre =
          Vector3d(0.4, 0, 1) + 0.9 * Vector3d(share(random), share(random), share(random));
      const double distance = DistanceOfThree(robot, from, centre);
      if (distance <= kRadius || distance > kRadius + 0.05) continue;
      ++balls;
      bool touched = false;
      for (int j = 0; j < 60 && !touched; ++j) {
        std::vector<double> q;
        for (size_t k = 0; k < 3; ++k) {
          const double along = j == 0 ? 1 : std::abs(share(random));
          q.push_back(from[k] + along * (to[k] - from[k]));
        }
        touched = DistanceOfThree(robot, q, centre) <= kRadius;
      }
      const double room = balls % 2 == 0 ? 0 : 0.01;
      const Vector3d off = room * Vector3d(share(random), share(random), share(random)) / 2;
      const bool may_meet = way.MayMeet(centre + off, room, kRadius);
      ASSERT_TRUE(may_meet || !touched) << "range " << i << ", " << centre.transpose();
      met += touched ? 1 : 0;
      not_met += !may_meet && way.MayReach(centre, kRadius) ? 1 : 0;
    }
  }
  EXPECT_GT(met, 300);
  EXPECT_GT(not_met, 50) << "of what is in reach";
}

// The fingers of a gripper, of which one moves the other way.
TEST_F(RobotBodyTest, BallsAreMetByLinksThatMimic) {
  constexpr double kRadius = 0.05;
  const RobotModel robot = Gripper();
  const RobotBody body(robot, {.tolerance = 0.005, .range = kRange, .step = kStep});
  Random random;
  const auto distance = [&](const std::vector<double>& q, size_t link, const Vector3d& point) {
    const LinkGeometry& geometry = robot.links()[link].visual[0];
    const Vector3d half = std::get<BoxShape>(geometry.shape).size / 2;
    const Vector3d at = (robot.LinkPoses(q)[link] * geometry.link_from_shape).inverse() * point;
    return Eigen::AlignedBox3d(-half, half).exteriorDistance(at);
  };
  const size_t links = robot.links().size();
  std::vector<int> met(links);
  int not_met = 0;
  for (int i = 0; i < 400; ++i) {
    std::vector<double> from;
    for (const RobotJoint& joint : robot.joints()) {
      from.push_back(Uniform(random, joint.lower, joint.upper));
    }
    std::vector<double> to = from;
    to.back() += Uniform(random, -0.1, 0.1);
    const PosedBody way = body.Between(from, to, 0.005);
    const size_t finger = links - 1 - random() % 3;
    for (int k = 0; k < 20; ++k) {
      const Vector3d centre = robot.LinkPoses(from)[finger].translation() +
                              Uniform(random, 0.06, 0.2) * RandomDirection(random);
      double before = 1;
      for (size_t link = 1; link < links; ++link) {
        before = std::min(before, distance(from, link, centre));
      }
      if (before <= kRadius) continue;
      bool touched = false;
      for (int step = 1; step <= 20; ++step) {
        std::vector<double> q = from;
        q.back() += step / 20.0 * (to.back() - from.back());
        touched = touched || distance(q, finger, centre) <= kRadius;
      }
      const bool may_meet = way.MayMeet(centre, 0, kRadius);
      ASSERT_TRUE(may_meet || !touched) << robot.links()[finger].name << ", motion " << i;
      met[finger] += touched ? 1 : 0;
      not_met += !may_meet && way.MayReach(centre, kRadius) ? 1 : 0;
    }
  }
  for (size_t finger = links - 3; finger < links; ++finger) EXPECT_GT(met[finger], 20);
  EXPECT_GT(not_met, 20) << "of what is in reach";
}

TEST_F(RobotBodyTest, WhatStandsStillInARangeHasNotMoved) {
  const RobotBody body(robot_, {.range = kRange, .step = kStep});
  const PosedBody present = body.At(std::vector{0.0});
  const std::vector<double> here{0.0}, there{0.2};
  const PosedBody moved = body.Between(here, there, 0.01).MovedFrom(present);
  EXPECT_FALSE(moved.MayReach({0, 0, 0}, 0)) << "the foot";
  EXPECT_TRUE(moved.MayReach({0.5, 0, 1}, 0)) << "the arm, though it is there now";
  EXPECT_FALSE(moved.MayReach({0.5, -0.12, 1}, 0)) << "it turns the other way";
  EXPECT_FALSE(body.Between(here, here, 0.01).MovedFrom(present).MayReach({0.5, 0, 1}, 0));
}

// A shell with holes, concave or flat.
TriangleMesh OpenMesh(Random& random) {
  TriangleMesh mesh = random() % 2 == 0 ? SphereMesh(0.1) : BoxMesh({0.3, 0.2, 0.1});
  const double bend = Uniform(random, 0, 3);
  const bool flat = random() % 5 == 0;
  for (Vector3d& vertex : mesh.vertices) {
    vertex.z() = flat ? 0.02 : vertex.z() + bend * vertex.x() * vertex.x();
  }
  std::ranges::shuffle(mesh.triangles, random);
  mesh.triangles.resize(mesh.triangles.size() * (1 + random() % 9) / 10 + 1);
  return mesh;
}

TEST_F(RobotBodyTest, SurfaceOfAnOpenMeshIsNeverMissedAndNothingInItIsCertain) {
  Random random;
  const RobotModel bare = Read("<robot name='bare'><link name='shell'/></robot>");
  for (int i = 0; i < std::max(SampleCount(8), 2); ++i) {
    const auto mesh = std::make_shared<const TriangleMesh>(OpenMesh(random));
    ASSERT_FALSE(IsClosed(*mesh));
    const Eigen::Isometry3d pose = RandomPose(random, {0.2, 0, 0});
    const RobotModel robot = bare.WithBody(
        0, {.shape = MeshShape{"shell.stl", mesh}, .link_from_shape = pose, .colour = {}});
    const RobotBody body(robot, {.range = kRange, .step = kStep});
    EXPECT_EQ(body.open_links(), std::vector<std::string>{"shell"});
    const PosedBody posed = body.At({});
    const MeshTree tree(*mesh);
    for (int j = 0; j < SampleCount(300); ++j) {
      const Vector3d on = SurfacePoint(random, *mesh);
      ASSERT_TRUE(posed.MayReach(pose * on, 1e-6)) << "mesh " << i;
      // What the shell may enclose, too.
      const Vector3d within = on + Uniform(random, 0, 1) * (SurfacePoint(random, *mesh) - on);
      ASSERT_TRUE(posed.MayReach(pose * within, 1e-6)) << "mesh " << i;
      ASSERT_GT(AtMost(posed, pose * within), 0);
      const Vector3d beside = on + Uniform(random, 0, 0.3) * RandomDirection(random);
      uint32_t hint = 0;
      ASSERT_TRUE(posed.MayReach(pose * beside, tree.Distance(beside, hint) + 1e-6));
    }
    EXPECT_FALSE(posed.MayReach({1, 1, 1}, 0.5));
  }
}

TEST_F(RobotBodyTest, OfALinkWithAnOpenMeshTheClosedOnesAreCertain) {
  WriteFile(TestFolder() / "open.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n");
  const RobotModel robot = Read(R"(<robot name="open"><link name="lid">
      <visual><geometry><mesh filename="open.obj"/></geometry></visual>
      <visual><origin xyz="-1 0 0"/><geometry><box size="0.1 0.1 0.1"/></geometry></visual>
      </link></robot>)");
  const RobotBody body(robot, {.range = kRange, .step = kStep});
  EXPECT_EQ(body.open_links(), std::vector<std::string>{"lid"});
  EXPECT_GT(AtMost(body.At({}), {0.1, 0.1, 0.1}), 0);
  EXPECT_LT(AtMost(body.At({}), {-1, 0, 0}), 0);
}

// A box of edges 0.4 m and a smaller one; turned the other way.
TriangleMesh WithABoxTurnedTheOtherWay(const Vector3d& size, const Vector3d& at) {
  TriangleMesh mesh = BoxMesh({0.4, 0.4, 0.4});
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  const TriangleMesh box = BoxMesh(size);
  for (const Vector3d& vertex : box.vertices) mesh.vertices.push_back(vertex + at);
  for (const auto& [a, b, c] : box.triangles) {
    mesh.triangles.push_back({first + a, first + c, first + b});
  }
  return mesh;
}

TEST_F(RobotBodyTest, PiecesThatAreInsideOutAndHollowsMayBeTouchedAndAreNamed) {
  const RobotModel bare = Read("<robot name='bare'><link name='shell'/></robot>");
  const Vector3d beside(1, 0, 0);
  const Vector3d at_a_corner(0.39, 0.39, 0.39);  // one vertex is in both
  for (const Vector3d& at : {Vector3d(0, 0, 0), beside, at_a_corner}) {
    const auto mesh =
        std::make_shared<const TriangleMesh>(WithABoxTurnedTheOtherWay({0.38, 0.38, 0.38}, at));
    ASSERT_TRUE(IsClosed(*mesh));
    const RobotModel robot = bare.WithBody(0, {.shape = MeshShape{"shell.stl", mesh},
                                               .link_from_shape = Eigen::Isometry3d::Identity(),
                                               .colour = {}});
    const RobotBody body(robot, {.range = kRange, .step = kStep});
    EXPECT_EQ(body.open_links(), std::vector<std::string>{"shell"});
    const PosedBody posed = body.At({});
    EXPECT_TRUE(posed.MayReach(at, 0.01));
    EXPECT_GT(AtMost(posed, at), 0) << "not certain";
    EXPECT_LT(AtMost(posed, {0.195, 0, 0}), 0.01) << "a wall, or the middle of the whole piece";
    EXPECT_FALSE(posed.MayReach({0, 0.5, 0}, 0.01));
  }
}

TEST_F(RobotBodyTest, TakesTheCollisionGeometryWhereItIsAskedTo) {
  const RobotBody body(robot_,
                       {.geometry = BodyGeometry::kCollision, .range = kRange, .step = kStep});
  EXPECT_LT(AtMost(body.At(std::vector{0.0}), {0.5, 0.5, 0.5}), 0) << "the foot's envelope";
  EXPECT_LT(AtMost(body.At(std::vector{0.0}), {0.5, 0, 1}), 0) << "the arm has none";
}

}  // namespace
}  // namespace silhouette
