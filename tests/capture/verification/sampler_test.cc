// SPDX-License-Identifier: Apache-2.0
// That a robot that is driven to samples stays clear of itself, the workspace's faces and forbidden
// regions, all along its way.
#include "capture/verification/sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;

struct SamplerTest : ::testing::Test {
  Configuration Upright() const { return Configuration(6, 0.0); }

  // Whether the corners of all parts are within the workspace.
  bool IsInside(const Configuration& q) const {
    std::vector<Eigen::Isometry3d> poses;
    robot.chain().Pose(q, poses);
    for (const RobotPart& part : robot.parts()) {
      if (part.link < 2) continue;  // base and shoulder only turn where they stand
      for (Eigen::Index i = 0; i < part.points.cols(); ++i) {
        const Vector3d at = poses[part.moves_with] * part.points.col(i);
        if (workspace.exteriorDistance(at) > 0) return false;
      }
    }
    return true;
  }

  // Those of the model, but for the fourth joint.
  static std::vector<GridJoint> RangesOf(const DrawnRobot& robot) {
    std::vector<GridJoint> joints;
    for (const ChainJoint& joint : robot.chain().joints()) {
      joints.push_back({.name = joint.name, .lower = joint.lower, .upper = joint.upper});
    }
    joints[3].lower = -1;
    joints[3].upper = 2;
    return joints;
  }

  DrawnRobot robot = Drawn(Rx130(), {});
  std::vector<GridJoint> joints = RangesOf(robot);
  Eigen::AlignedBox3d workspace{Vector3d(-1.8, -1.8, 0), Vector3d(1.8, 1.8, 2.3)};
  ModelSampler sampler{robot, joints, workspace, {}, {}, 1};
};

TEST_F(SamplerTest, WaysStayInTheWorkspaceAndReachAllRanges) {
  Configuration here = Upright();
  ASSERT_TRUE(sampler.IsClear(here));
  std::vector<Configuration> places;
  for (int i = 0; i < 60; ++i) {
    const auto next = sampler.Next(here);
    ASSERT_TRUE(next.has_value()) << i;
    for (int k = 0; k <= 50; ++k) {
      Configuration q = here;
      for (size_t j = 0; j < 6; ++j) q[j] += k / 50.0 * ((*next)[j] - here[j]);
      EXPECT_TRUE(IsInside(q));
    }
    here = *next;
    places.push_back(here);
  }
  for (size_t j = 0; j < 6; ++j) {
    const GridJoint& joint = joints[j];
    double lowest = joint.upper;
    double highest = joint.lower;
    for (const Configuration& q : places) {
      lowest = std::min(lowest, q[j]);
      highest = std::max(highest, q[j]);
      EXPECT_GE(q[j], joint.lower);
      EXPECT_LE(q[j], joint.upper);
    }
    EXPECT_GT(highest - lowest, 0.4 * (joint.upper - joint.lower)) << joint.name;
  }
}

TEST_F(SamplerTest, LinksThatKeepJustTheClearanceDoNotStopTheRobot) {
  // 3 cm from the wrist to the tool, with half a centimetre more on each.
  std::vector<RobotPart> parts = robot.parts();
  for (RobotPart& part : parts) part.radius += 0.005;
  const DrawnRobot grown(robot.chain(), parts, {});
  ModelSampler of_grown(grown, joints, workspace, {}, {}, 1);
  EXPECT_TRUE(of_grown.Next(Upright()).has_value());
}

TEST_F(SamplerTest, RobotThatMeetsItselfOrTheFloorIsNotClear) {
  EXPECT_FALSE(sampler.IsClear(Configuration{0, 2.3, 0, 0, 0, 0})) << "in the floor";
  EXPECT_FALSE(sampler.IsClear(Configuration{0, -0.6, 2.48, 0, 1.2, 0})) << "the tool in the arm";
  EXPECT_FALSE(sampler.IsClearWay(Configuration{0, 1.2, 1.0, 0, 0, 0},
                                  Configuration{0, -1.2, -1.0, 0, 3.5, 0}));
}

TEST_F(SamplerTest, ForbiddenWaysAreNotTaken) {
  const JointRegions forbidden({{{.joint = 0, .lower = 0.5, .upper = 10}}});
  ModelSampler guarded(robot, joints, workspace, forbidden, {}, 1);
  Configuration here = Upright();
  for (int i = 0; i < 20; ++i) {
    here = guarded.Next(here).value();
    EXPECT_LE(here[0], 0.5);
  }
  EXPECT_FALSE(guarded.Next(Configuration{1, 0, 0, 0, 0, 0}).has_value());
}

TEST_F(SamplerTest, TheSameSeedGivesTheSamePlaces) {
  ModelSampler again(robot, joints, workspace, {}, {}, 1);
  ModelSampler other(robot, joints, workspace, {}, {}, 2);
  const Configuration first = sampler.Next(Upright()).value();
  EXPECT_EQ(again.Next(Upright()).value(), first);
  EXPECT_NE(other.Next(Upright()).value(), first);
}

}  // namespace
}  // namespace silhouette
