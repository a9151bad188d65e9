// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/pose_plan.h"

#include <gtest/gtest.h>

#include "tests/calib/robot/urdf_files.h"

namespace silhouette {
namespace {

RobotModel PosePlanThreeJoints() {
  return RobotModel::FromUrdf(WriteFile(FreshFolder() / "three.urdf", ThreeJointUrdf())).value();
}

PosePlan::Positions Rest(const RobotModel& robot) {
  return PosePlan::Positions(robot.joints().size(), 0.1);
}

const PosePlan::Allowed kAll = [](const PosePlan::Positions&) { return true; };

TEST(PosePlan, OnlyTheNamedJointsMoveAndStayInTheirRange) {
  const RobotModel robot = PosePlanThreeJoints();
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
  const RobotModel robot = PosePlanThreeJoints();
  PosePlan plan(robot, 3, Rest(robot), {{0, -1, 1}, {1, -1, 1}}, 2);
  const auto next = plan.Next([](const PosePlan::Positions& p) { return p[0] > 0.5; });
  ASSERT_TRUE(next.has_value());
  EXPECT_GT((*next)[0], 0.5);
  EXPECT_FALSE(plan.Next([](const PosePlan::Positions&) { return false; }).has_value());
}

TEST(PosePlan, MostPosesAreNearThoseInWhichTheBoardWasSeen) {
  const RobotModel robot = PosePlanThreeJoints();
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
  const RobotModel robot = PosePlanThreeJoints();
  EXPECT_THROW(PosePlan(robot, 3, Rest(robot), {}, 1), std::invalid_argument);
  EXPECT_THROW(PosePlan(robot, 3, Rest(robot), {{7, 0, 1}}, 1), std::invalid_argument);
  EXPECT_THROW(PosePlan(robot, 3, {0.0}, {{0, 0, 1}}, 1), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
