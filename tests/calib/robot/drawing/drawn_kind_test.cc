// SPDX-License-Identifier: Apache-2.0
// Own and reach images of nodes of an arm, compared with the robot at many configurations of their
// cells.
#include "calib/robot/drawing/drawn_kind.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// The first joints have some steps, all others one.
ConfigurationGrid ArmGrid(const KinematicChain& chain, size_t arm_joints, double step) {
  std::vector<GridJoint> joints;
  for (const ChainJoint& of_chain : chain.joints()) {
    GridJoint& joint = joints.emplace_back();
    joint.name = of_chain.name;
    joint.continuous = of_chain.continuous;
    joint.lower = joint.continuous ? -std::numbers::pi : of_chain.lower;
    joint.upper = joint.continuous ? std::numbers::pi : of_chain.upper;
    if (joints.size() > arm_joints) continue;
    joint.steps = joint.lower == joint.upper
                      ? 1
                      : std::max(3, static_cast<int>((joint.upper - joint.lower) / step));
  }
  return ConfigurationGrid(std::move(joints));
}

Configuration AnyOf(const ConfigurationGrid& grid, Random& random) {
  Configuration q;
  for (const GridJoint& joint : grid.joints()) {
    q.push_back(Uniform(random, joint.lower, joint.upper));
    // Limits are where wrists are bent the most.
    if (random() % 8 == 0) q.back() = random() % 2 == 0 ? joint.lower : joint.upper;
    if (joint.continuous && random() % 2 == 0) q.back() += 2 * std::numbers::pi;
  }
  return q;
}

// All of the robot is before the cameras, `away` metres farther than CameraAbout has them.
DrawnRobot SeenFrom(const DrawnRobot& robot, Random& random, int views, double away) {
  std::vector<PartDrawer> drawers;
  for (int view = 0; view < views; ++view) {
    const CameraModel camera = CameraAbout(random);
    drawers.emplace_back(CameraModel(camera.intrinsics(),
                                     Eigen::Translation3d(0, 0, away) * camera.camera_from_world()),
                         RandomMaskSize(random), random() % 2 == 0 ? 0 : 0.5);
  }
  return {robot.chain(), robot.parts(), std::move(drawers)};
}

// A chain of some joints, turning about or sliding along random axes, with a part or two on most
// links; one joint moves two links.
DrawnRobot RandomChain(Random& random, int joints) {
  std::vector<ChainJoint> chain;
  std::vector<ChainLink> links(1);
  std::vector<RobotPart> parts;
  for (int j = 0; j < joints; ++j) {
    ChainJoint& joint = chain.emplace_back();
    joint.name = "joint " + std::to_string(j);
    joint.continuous = random() % 4 == 0;
    const bool slides = !joint.continuous && random() % 4 == 0;
    joint.lower = slides ? Uniform(random, -0.2, 0) : Uniform(random, -4, 0);
    joint.upper = slides ? Uniform(random, 0, 0.3) : Uniform(random, 0, 4);
    for (size_t times = random() % 5 == 0 ? 2 : 1; times > 0; --times) {
      ChainLink& link = links.emplace_back();
      link.parent = static_cast<int>(links.size()) - 2 - (links.size() > 3 && random() % 6 == 0);
      link.joint = j;
      link.slides = slides;
      if (times == 2) link.factor = -0.5;
      if (times == 2) link.offset = 0.1;
      link.parent_from_link =
          RandomPose(random, Uniform(random, 0, 0.35) * RandomDirection(random));
      link.axis = RandomDirection(random);
    }
  }
  for (size_t link = 0; link < links.size(); ++link) {
    for (size_t part = random() % 3; part > 0 || (link == 0 && part == 0 && parts.empty());
         --part) {
      Eigen::Matrix3Xd points(3, 1 + static_cast<Eigen::Index>(random() % 12));
      for (Eigen::Index i = 0; i < points.cols(); ++i) {
        points.col(i) = Uniform(random, 0, 0.3) * RandomDirection(random);
      }
      parts.push_back({.link = link,
                       .moves_with = link,
                       .points = points,
                       .radius = random() % 4 == 0 ? 0.08 : 0.01,
                       .inner = {}});
      if (part == 0) break;
    }
  }
  return {KinematicChain(std::move(chain), std::move(links)), std::move(parts), {}};
}

void ExpectReachHolds(const DrawnRobot& robot, const ConfigurationGrid& grid, Random& random,
                      int configurations) {
  const DrawnRobot reach = AsKind(robot, grid, DrawnKind::kReach);
  for (int i = 0; i < configurations; ++i) {
    const Configuration q = AnyOf(grid, random);
    const Configuration node = grid.At(grid.Nearest(q).value());
    const std::vector<Mask> there = robot.Touched(q);
    const std::vector<Mask> reached = reach.Touched(node);
    for (size_t view = 0; view < there.size(); ++view) {
      ASSERT_EQ((there[view] - reached[view]).Count(), 0U) << "view " << view;
    }
  }
}

TEST(DrawnKind, ReachHoldsTheRobotInAllOfTheNodesCellWhateverTheWristDoes) {
  Random random;
  for (int trial = 0; trial < 4; ++trial) {
    const DrawnRobot robot = SeenFrom(Drawn(Rx130(), {}), random, 4, 1);
    const size_t arm_joints = 1 + random() % 5;
    const ConfigurationGrid grid = ArmGrid(robot.chain(), arm_joints, Uniform(random, 0.05, 0.4));
    ExpectReachHolds(robot, grid, random, SampleCount(60));
  }
}

TEST(DrawnKind, ReachHoldsChainsOfAnyKind) {
  Random random;
  for (int trial = 0; trial < 15; ++trial) {
    const int joints = 2 + static_cast<int>(random() % 4);
    const DrawnRobot robot = SeenFrom(RandomChain(random, joints), random, 2, 3.5);
    const size_t arm_joints = random() % static_cast<size_t>(joints);
    const ConfigurationGrid grid = ArmGrid(robot.chain(), arm_joints, Uniform(random, 0.1, 0.8));
    ExpectReachHolds(robot, grid, random, SampleCount(40));
  }
}

TEST(DrawnKind, OwnIsPartOfTheRobotWhateverTheWristDoes) {
  Random random;
  const DrawnRobot robot = SeenFrom(Drawn(Rx130(), {}), random, 4, 1);
  const ConfigurationGrid grid = ArmGrid(robot.chain(), 3, 0.1);
  const DrawnRobot own = AsKind(robot, grid, DrawnKind::kOwn);
  for (int i = 0; i < SampleCount(200); ++i) {
    Configuration q = AnyOf(grid, random);
    const Configuration node = grid.At(grid.Nearest(q).value());
    std::copy_n(node.begin(), 3, q.begin());
    const std::vector<Mask> there = robot.Touched(q);
    const std::vector<Mask> of_arm = own.Touched(node);
    for (size_t view = 0; view < there.size(); ++view) {
      ASSERT_EQ((of_arm[view] - there[view]).Count(), 0U) << "view " << view;
    }
  }
}

// Against the union over many configurations of the cell.
TEST(DrawnKind, ReachIsLittleLargerThanWhatTheRobotReaches) {
  Random random;
  std::vector<PartDrawer> views;
  for (int view = 0; view < 4; ++view) views.emplace_back(CameraAbout(random), MaskSize{64, 64});
  const DrawnRobot robot = Drawn(Rx130(), std::move(views));
  const ConfigurationGrid grid = ArmGrid(robot.chain(), 3, 0.04);
  const DrawnRobot reach = AsKind(robot, grid, DrawnKind::kReach);
  size_t reached = 0;
  size_t of_robot = 0;
  for (int i = 0; i < SampleCount(6); ++i) {
    const Configuration node = grid.At(grid.Nearest(AnyOf(grid, random)).value());
    std::vector<Mask> all = robot.Touched(node);
    for (int k = 0; k < 800; ++k) {
      Configuration q = AnyOf(grid, random);
      for (size_t j = 0; j < 3; ++j) {
        q[j] = node[j] + Uniform(random, -0.5, 0.5) * grid.joints()[j].step();
      }
      const std::vector<Mask> there = robot.Touched(q);
      for (size_t view = 0; view < all.size(); ++view) all[view] = all[view] | there[view];
    }
    const std::vector<Mask> masks = reach.Touched(node);
    for (size_t view = 0; view < all.size(); ++view) {
      reached += masks[view].Count();
      of_robot += all[view].Count();
    }
  }
  RecordProperty("share",
                 std::to_string(static_cast<double>(reached) / static_cast<double>(of_robot)));
  EXPECT_LT(static_cast<double>(reached), 1.35 * static_cast<double>(of_robot));
}

TEST(DrawnKind, AreThoseOfTheGrid) {
  const DrawnRobot robot = Drawn(Rx130(), {});
  EXPECT_THAT(KindsFor(ArmGrid(robot.chain(), 6, 0.5)), ElementsAre(DrawnKind::kWhole));
  EXPECT_THAT(KindsFor(ArmGrid(robot.chain(), 3, 0.5)),
              ElementsAre(DrawnKind::kOwn, DrawnKind::kReach));
  EXPECT_EQ(NameOf(DrawnKind::kWhole), "whole");
  EXPECT_EQ(NameOf(DrawnKind::kOwn), "own");
  EXPECT_EQ(NameOf(DrawnKind::kReach), "reach");
}

TEST(DrawnKind, RefuseAnotherRobotsGridAndAnArmWithoutParts) {
  const DrawnRobot robot = Drawn(Rx130(), {});
  const ConfigurationGrid other({{.name = "joint", .lower = 0, .upper = 1, .steps = 2}});
  EXPECT_THROW(AsKind(robot, other, DrawnKind::kWhole), std::invalid_argument);
  Random random;
  const DrawnRobot chain = RandomChain(random, 2);
  std::vector<RobotPart> outer;
  for (const RobotPart& part : chain.parts()) {
    outer.push_back(part);
    outer.back().moves_with = 1;
  }
  const DrawnRobot moved(chain.chain(), std::move(outer), {});
  try {
    AsKind(moved, ArmGrid(chain.chain(), 0, 1), DrawnKind::kOwn);
    ADD_FAILURE();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("nothing is left to draw of the arm"));
  }
}

}  // namespace
}  // namespace silhouette
