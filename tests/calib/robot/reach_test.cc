// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <cmath>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "calib/robot/pose_plan.h"
#include "calib/robot/reach.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// The links' origins and the corners of their bodies, in the base's frame.
std::vector<Eigen::Vector3d> PointsOf(const RobotModel& robot, std::span<const double> positions) {
  std::vector<Eigen::Vector3d> points;
  const auto base_from_link = robot.LinkPoses(positions);
  for (size_t link = 0; link < robot.links().size(); ++link) {
    points.emplace_back(base_from_link[link].translation());
    for (const LinkGeometry& geometry : robot.links()[link].body()) {
      for (const Eigen::Vector3d& vertex : Tessellate(geometry.shape).vertices) {
        points.emplace_back(base_from_link[link] * (geometry.link_from_shape * vertex));
      }
    }
  }
  return points;
}

TEST(Reach, IsExactOverFixedJoints) {
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> moving{"turn"};
  // Bent straight up, slid out: the ball's far side is 0.5 + 0.05 from the axis of `turn`; the
  // farthest corner of the upper arm's box is (0.5, 0.05).
  const std::vector<FixedJoint> up{{"bend", -std::acos(0.0)}, {"slide", 0.2}};
  EXPECT_NEAR(Reach(robot, "turn", moving, up, 0).value(), 0.55, 1e-9);
  const std::vector<FixedJoint> out{{"bend", 0}, {"slide", 0.2}};
  EXPECT_NEAR(Reach(robot, "turn", moving, out, 0).value(), 0.5 + 0.4 + 0.2 + 0.05, 1e-9);
}

TEST(Reach, OverMovingJointsIsTheArmStretchedOut) {
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> moving{"turn", "bend", "slide"};
  EXPECT_NEAR(Reach(robot, "turn", moving, {}, 0).value(), 0.5 + 0.4 + 0.3 + 0.05, 1e-9);
  EXPECT_NEAR(Reach(robot, "bend", moving, {}, 0).value(), 0.4 + 0.3 + 0.05, 1e-9);
}

TEST(Reach, PayloadReachesBeyondTheLastLink) {
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> moving{"bend"};
  const std::vector<FixedJoint> fixed{{"turn", 0}, {"slide", 0}};
  EXPECT_NEAR(Reach(robot, "bend", moving, fixed, 0.1).value(), 0.4 + 0.05 + 0.1, 1e-9);
}

const Eigen::AlignedBox3d kRoom(Eigen::Vector3d(-2, -2, -1), Eigen::Vector3d(2, 2, 3));

std::optional<LinkBeyond> BeyondOf(const Eigen::AlignedBox3d& box, const JointRegions& forbidden,
                                   double payload_radius = 0) {
  const std::vector<GridJoint> moving{{.name = "turn", .lower = -2, .upper = 2},
                                      {.name = "bend", .lower = -1.5, .upper = 0},
                                      {.name = "slide", .lower = 0, .upper = 0.3}};
  return FarthestBeyond(ThreeJoints(), BodyGeometry::kVisual, moving, {}, forbidden, payload_radius,
                        box)
      .value();
}

TEST(FarthestBeyond, NothingIsBeyondABoxThatHoldsTheRobot) {
  EXPECT_FALSE(BeyondOf(kRoom, {}).has_value());
}

TEST(FarthestBeyond, TheLinkTheFaceAndHowFarAreThoseOfTheFarthestConfiguration) {
  Eigen::AlignedBox3d low = kRoom;
  low.max().z() = 1.5;
  const auto over = BeyondOf(low, {});
  ASSERT_TRUE(over.has_value());
  EXPECT_EQ(over->link, 3u);
  EXPECT_EQ(over->face, 5);
  // Bent up and slid out: the ball's top is 0.7 and its radius above the joint at 1 m.
  EXPECT_NEAR(over->by, 0.7 * std::sin(1.5) + 0.05 - 0.5, 1e-9);
  EXPECT_NEAR(over->q[1], -1.5, 1e-9);
  EXPECT_NEAR(over->q[2], 0.3, 1e-9);

  Eigen::AlignedBox3d narrow = kRoom;
  narrow.min().y() = -1;
  const auto beside = BeyondOf(narrow, {});
  ASSERT_TRUE(beside.has_value());
  EXPECT_EQ(beside->face, 1);
  EXPECT_NEAR(beside->by, 0.5 + 0.7 + 0.05 - 1, 0.001) << "between the configurations of a grid";
}

TEST(FarthestBeyond, ToolAndPayloadCountAtTheOutermostLink) {
  Eigen::AlignedBox3d low = kRoom;
  low.max().z() = 1.5;
  EXPECT_NEAR(BeyondOf(low, {}, 0.2)->by, BeyondOf(low, {})->by + 0.2, 1e-9);
}

TEST(FarthestBeyond, ForbiddenJointValuesDoNotCount) {
  Eigen::AlignedBox3d low = kRoom;
  low.max().z() = 1.7;
  EXPECT_TRUE(BeyondOf(low, {}).has_value());
  EXPECT_FALSE(BeyondOf(low, JointRegions({{{.joint = 1, .lower = -1.5, .upper = -0.9}},
                                           {{.joint = 2, .lower = 0.2, .upper = 0.3}}}))
                   .has_value());
}

TEST(FarthestBeyond, WhatNoJointMovesMayBeAnywhere) {
  // All but the ball stands still, half outside.
  const std::vector<GridJoint> moving{{.name = "slide", .lower = 0, .upper = 0.3}};
  const std::vector<FixedJoint> fixed{{"turn", 0}, {"bend", 0}};
  const Eigen::AlignedBox3d box(Eigen::Vector3d(0.8, -1, 0), Eigen::Vector3d(2, 1, 2));
  EXPECT_FALSE(FarthestBeyond(ThreeJoints(), BodyGeometry::kVisual, moving, fixed, {}, 0, box)
                   .value()
                   .has_value());
}

TEST(MeanSweeps, AreSurfaceTimesWay) {
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> moving{"turn", "bend", "slide"};
  const auto sweeps = MeanSweeps(robot, moving, {}, std::vector{0.01, 0.01, 0.01});
  ASSERT_TRUE(sweeps.ok()) << sweeps.status();
  // All that slides moves by the step: a ball of radius 0.05, whose triangles are a little less.
  const double ball = 4 * std::numbers::pi * 0.05 * 0.05 * 0.01;
  EXPECT_LT((*sweeps)[2], ball);
  EXPECT_GT((*sweeps)[2], 0.9 * ball);
  EXPECT_GT((*sweeps)[0], (*sweeps)[1]);
  EXPECT_GT((*sweeps)[1], (*sweeps)[2] / 2);
  const auto longer = MeanSweeps(robot, moving, {}, std::vector{0.01, 0.01, 0.03});
  EXPECT_NEAR((*longer)[2], 3 * (*sweeps)[2], 1e-12);
  EXPECT_FALSE(MeanSweeps(robot, std::vector<std::string>{"turn"}, {}, std::vector{0.1}).ok());
}

TEST(Reach, NoConfigurationReachesFarther) {
  Random random;
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> names{"turn", "bend", "slide"};
  for (int round = 0; round < 50; ++round) {
    std::vector<double> positions;
    for (const RobotJoint& joint : robot.joints()) {
      positions.push_back(std::uniform_real_distribution(joint.lower, joint.upper)(random));
    }
    // Each of the outboard joints moves or stands still, as chance will have it.
    std::vector<std::string> moving{"turn"};
    std::vector<FixedJoint> fixed;
    for (size_t j = 1; j < 3; ++j) {
      if (random() % 2 == 0) {
        moving.push_back(names[j]);
      } else {
        fixed.push_back({names[j], positions[j]});
      }
    }
    const double reach = Reach(robot, "turn", moving, fixed, 0).value();
    for (const Eigen::Vector3d& point : PointsOf(robot, positions)) {
      EXPECT_LE(point.head<2>().norm(), reach + 1e-9);  // the axis of `turn` is z
    }
  }
}

TEST(ReachBox, HoldsTheRobotAtEveryConfigurationAndIsTightWhereNothingMoves) {
  Random random;
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> names{"turn", "bend", "slide"};
  for (int round = 0; round < 50; ++round) {
    std::vector<double> positions;
    std::vector<std::string> moving;
    std::vector<FixedJoint> fixed;
    for (size_t j = 0; j < 3; ++j) {
      const RobotJoint& joint = robot.joints()[j];
      positions.push_back(std::uniform_real_distribution(joint.lower, joint.upper)(random));
      if (round > 0 && random() % 2 == 0) {
        moving.push_back(names[j]);
      } else {
        fixed.push_back({names[j], positions[j]});
      }
    }
    const Eigen::AlignedBox3d box = ReachBox(robot, moving, fixed, 0).value();
    Eigen::AlignedBox3d occupied;
    for (const Eigen::Vector3d& point : PointsOf(robot, positions)) occupied.extend(point);
    const Eigen::Vector3d slack = Eigen::Vector3d::Constant(1e-9);
    EXPECT_TRUE(Eigen::AlignedBox3d(box.min() - slack, box.max() + slack).contains(occupied));
    if (moving.empty()) {
      EXPECT_LT((box.sizes() - occupied.sizes()).norm(), 0.05);
    }
  }
}

TEST(Reach, OfAJointThatSlidesIsOne) {
  EXPECT_EQ(Reach(ThreeJoints(), "slide", std::vector<std::string>{"slide"}, {}, 0).value(), 1);
}

TEST(Reach, CountsWhatMimicsTheJoint) {
  Random random;
  const RobotModel robot = Gripper();
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints()) names.push_back(joint.name);
  std::vector<double> reaches;
  for (const std::string& name : names) {
    reaches.push_back(Reach(robot, name, names, {}, 0).value());
  }
  // The tip slides with its finger, and turns by three radians a metre.
  EXPECT_GT(reaches.back(), 1.2);
  EXPECT_LT(reaches.back(), 1.5);
  double closest = 0;
  for (int trial = 0; trial < 400; ++trial) {
    std::vector<double> q;
    for (const RobotJoint& joint : robot.joints()) {
      q.push_back(std::uniform_real_distribution(joint.lower, joint.upper)(random));
    }
    const std::vector<Eigen::Vector3d> before = PointsOf(robot, q);
    const size_t j = random() % names.size();
    constexpr double kMove = 1e-3;
    q[j] += kMove;
    const std::vector<Eigen::Vector3d> after = PointsOf(robot, q);
    for (size_t i = 0; i < before.size(); ++i) {
      const double moved = (after[i] - before[i]).norm();
      EXPECT_LE(moved, reaches[j] * kMove + 1e-9) << names[j];
      if (j == names.size() - 1) closest = std::max(closest, moved / (reaches[j] * kMove));
    }
  }
  EXPECT_GT(closest, 0.8);
}

TEST(Reach, MistakesAreNamed) {
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> moving{"turn"};
  const auto error = [&](const std::string& joint, std::vector<FixedJoint> fixed) {
    return std::string(Reach(robot, joint, moving, fixed, 0).status().message());
  };
  EXPECT_THAT(error("elbow", {}), HasSubstr("no joint 'elbow'"));
  EXPECT_THAT(error("turn", {{"bend", 0}}), HasSubstr("'slide' neither moves"));
  EXPECT_THAT(error("turn", {{"bend", 0}, {"wrist", 0}}), HasSubstr("no joint 'wrist'"));
  EXPECT_THAT(std::string(ReachBox(robot, moving, {}, 0).status().message()),
              HasSubstr("'bend' neither moves"));
}

PosePlan::Positions Rest(const RobotModel& robot) {
  return PosePlan::Positions(robot.joints().size(), 0.1);
}

const PosePlan::Allowed kAll = [](const PosePlan::Positions&) { return true; };

TEST(PosePlan, OnlyTheNamedJointsMoveAndStayInTheirRange) {
  const RobotModel robot = ThreeJoints();
  PosePlan plan(robot, 3, Rest(robot), {{0, -0.5, 0.25}}, 1);
  for (int i = 0; i < 20; ++i) {
    const auto next = plan.Next(kAll);
    ASSERT_TRUE(next.has_value());
    EXPECT_GE((*next)[0], -0.5);
    EXPECT_LE((*next)[0], 0.25);
    EXPECT_EQ((*next)[1], 0.1);
    EXPECT_EQ((*next)[2], 0.1);
    plan.Tell(*next, {});
  }
}

TEST(PosePlan, WhatIsNotAllowedIsNeverProposed) {
  const RobotModel robot = ThreeJoints();
  PosePlan plan(robot, 3, Rest(robot), {{0, -1, 1}, {1, -1, 1}}, 2);
  const auto next = plan.Next([](const PosePlan::Positions& p) { return p[0] > 0.5; });
  ASSERT_TRUE(next.has_value());
  EXPECT_GT((*next)[0], 0.5);
  EXPECT_FALSE(plan.Next([](const PosePlan::Positions&) { return false; }).has_value());
}

TEST(PosePlan, MostPosesAreNearThoseInWhichTheBoardWasSeen) {
  const RobotModel robot = ThreeJoints();
  PosePlan plan(robot, 3, Rest(robot), {{0, -2, 2}}, 3);
  // A camera on one side: the board is seen where the first joint is beyond 1.
  const std::vector<std::string> view{"left"};
  int seen = 0;
  for (int i = 0; i < 40; ++i) {
    const auto next = plan.Next(kAll).value();
    const bool sees = next[0] > 1;
    seen += sees ? 1 : 0;
    plan.Tell(next, sees ? view : std::vector<std::string>());
  }
  EXPECT_GT(seen, 13) << "by chance it would be ten";
}

TEST(PosePlan, NoJointOrAnUnknownOneIsAMistake) {
  const RobotModel robot = ThreeJoints();
  EXPECT_THROW(PosePlan(robot, 3, Rest(robot), {}, 1), std::invalid_argument);
  EXPECT_THROW(PosePlan(robot, 3, Rest(robot), {{7, 0, 1}}, 1), std::invalid_argument);
  EXPECT_THROW(PosePlan(robot, 3, {0.0}, {{0, 0, 1}}, 1), std::invalid_argument);
}

}  // namespace

}  // namespace silhouette
