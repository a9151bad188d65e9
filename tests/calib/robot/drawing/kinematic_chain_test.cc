// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/kinematic_chain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "calib/robot/robot_model.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

// Three links; the second slides, and the third turns about an axis across.
constexpr char kRobot[] =
    "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>"
    "<joint name='turn' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
    "<origin xyz='0 0 0.5' rpy='0.1 0.2 0.3'/><limit lower='-2' upper='2' effort='1' "
    "velocity='1'/></joint>"
    "<joint name='slide' type='prismatic'><parent link='b'/><child link='c'/><axis xyz='1 0 0'/>"
    "<origin xyz='0.3 0 0'/><limit lower='-0.1' upper='0.4' effort='1' velocity='1'/></joint>"
    "<joint name='bend' type='continuous'><parent link='c'/><child link='d'/><axis xyz='0 1 0'/>"
    "<origin xyz='0 0.2 0'/></joint></robot>";

RobotModel Model() {
  return RobotModel::FromUrdf(WriteFile(FreshFolder() / "r.urdf", kRobot)).value();
}

std::vector<double> RandomValues(Random& random) {
  return {Uniform(random, -2, 2), Uniform(random, -0.1, 0.4), Uniform(random, -3, 3)};
}

TEST(KinematicChain, LinksStandAsInTheModelWhicheverJointsMove) {
  Random random;
  const RobotModel model = Model();
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<double> q = RandomValues(random);
    const std::vector<Isometry3d> expected = model.LinkPoses(q);
    const auto all = model.ChainOf(std::vector<std::string>{"bend", "turn", "slide"}, {});
    const auto some = model.ChainOf(std::vector<std::string>{"bend", "turn"},
                                    std::vector<FixedJoint>{{"slide", q[1]}});
    ASSERT_TRUE(all.ok() && some.ok()) << all.status() << some.status();
    std::vector<Isometry3d> poses;
    all->Pose(std::vector<double>{q[2], q[0], q[1]}, poses);
    ASSERT_EQ(poses.size(), expected.size());
    std::vector<Isometry3d> of_some;
    some->Pose(std::vector<double>{q[2], q[0]}, of_some);
    for (size_t link = 0; link < poses.size(); ++link) {
      EXPECT_TRUE(poses[link].isApprox(expected[link], 1e-12));
      EXPECT_TRUE(of_some[link].isApprox(expected[link], 1e-12));
    }
  }
}

TEST(KinematicChain, LinksTurnByAnyAngle) {
  Random random;
  const Eigen::Vector3d axis = RandomDirection(random);
  std::vector<ChainJoint> joints;
  std::vector<ChainLink> links(1);
  for (int i = 0; i < 5; ++i) {
    joints.push_back({.name = "j" + std::to_string(i), .continuous = true});
    links.push_back({.parent = 0, .joint = i, .axis = axis});
  }
  const KinematicChain chain(joints, links);
  std::vector<Isometry3d> poses;
  for (int trial = 0; trial < 20000; ++trial) {
    std::vector<double> q;
    for (int i = 0; i < 5; ++i) {
      switch (random() % 4) {
        case 0:
          q.push_back(Uniform(random, -7, 7));
          break;
        case 1:  // at eighths of turns, or nearly
          q.push_back(std::numbers::pi / 4 * std::round(Uniform(random, -40, 40)) +
                      Uniform(random, -1e-9, 1e-9));
          break;
        case 2:
          q.push_back(Uniform(random, -1e6, 1e6));
          break;
        default:
          q.push_back(Uniform(random, -1, 1) * std::pow(10, Uniform(random, -20, 15)));
      }
    }
    chain.Pose(q, poses);
    for (size_t i = 0; i < 5; ++i) {
      const Eigen::Matrix3d expected = Eigen::AngleAxisd(q[i], axis).toRotationMatrix();
      ASSERT_LT((poses[i + 1].linear() - expected).cwiseAbs().maxCoeff(), 2e-15) << q[i];
      ASSERT_TRUE(poses[i + 1].translation().isZero(0));
    }
  }
}

TEST(KinematicChain, NoPointMovesFartherThanItsLevers) {
  Random random;
  const RobotModel model = Model();
  const KinematicChain chain =
      model.ChainOf(std::vector<std::string>{"turn", "slide", "bend"}, {}).value();
  EXPECT_EQ(chain.LeverOf(2, 2, 0.3), 0);  // a joint farther out
  double closest = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const std::vector<double> from = RandomValues(random);
    std::vector<double> to = RandomValues(random);
    if (trial % 2 == 0) {
      const size_t moved = random() % 3;
      for (size_t j = 0; j < 3; ++j) to[j] = j == moved ? to[j] : from[j];
    }
    const Vector3d point = RandomDirection(random) * 0.3;
    const double moved =
        (model.LinkPoses(from).back() * point - model.LinkPoses(to).back() * point).norm();
    double bound = 0;
    for (size_t j = 0; j < 3; ++j) {
      bound += std::abs(to[j] - from[j]) * chain.LeverOf(j, 3, 0.3);
    }
    EXPECT_LE(moved, bound + 1e-12);
    closest = std::max(closest, moved / bound);
  }
  EXPECT_GT(closest, 0.9);  // of a slide, which moves all by the same
}

TEST(KinematicChain, LinksThatMimicMoveWithTheJointThatTheyMimic) {
  Random random;
  const RobotModel model = Gripper();
  const RobotModel without_mimics = Gripper(false);
  std::vector<std::string> names;
  for (const RobotJoint& joint : model.joints()) names.push_back(joint.name);
  ASSERT_EQ(names.size(), 8u);
  ASSERT_EQ(names.back(), "left");
  const KinematicChain all = model.ChainOf(names, {}).value();
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> q;
    for (size_t j = 0; j < names.size(); ++j) q.push_back(Uniform(random, -0.1, 0.4));
    const std::vector<Isometry3d> expected = without_mimics.LinkPoses(WithMimics(q));
    const std::vector<Isometry3d> poses = model.LinkPoses(q);
    const std::vector<std::string> moving(names.begin(), names.end() - 1);
    const auto arm = model.ChainOf(moving, std::vector<FixedJoint>{{"left", q.back()}});
    ASSERT_TRUE(arm.ok()) << arm.status();
    std::vector<Isometry3d> of_arm;
    arm->Pose(std::span(q).first(moving.size()), of_arm);
    ASSERT_EQ(poses.size(), expected.size());
    for (size_t link = 0; link < poses.size(); ++link) {
      EXPECT_TRUE(poses[link].isApprox(expected[link], 1e-12)) << model.links()[link].name;
      EXPECT_TRUE(of_arm[link].isApprox(expected[link], 1e-12)) << model.links()[link].name;
    }
    std::vector<double> to = q;
    for (double& value : to) value += Uniform(random, -0.05, 0.05);
    const std::vector<Isometry3d> there = model.LinkPoses(to);
    const Vector3d point = RandomDirection(random) * 0.1;
    for (size_t link = 0; link < poses.size(); ++link) {
      double bound = 0;
      for (size_t j = 0; j < q.size(); ++j) {
        bound += std::abs(to[j] - q[j]) * all.LeverOf(j, link, 0.1);
      }
      EXPECT_LE((there[link] * point - poses[link] * point).norm(), bound + 1e-12);
    }
  }
}

// Factors and offsets of mimics count, and no more than they do: one joint moves, a little.
TEST(KinematicChain, LeversOfLinksThatMimicAreAsLongAsTheirFactorsSay) {
  Random random;
  const RobotModel model = Gripper();
  std::vector<std::string> names;
  for (const RobotJoint& joint : model.joints()) names.push_back(joint.name);
  const KinematicChain chain = model.ChainOf(names, {}).value();
  const size_t left = names.size() - 1;
  const size_t tip = model.links().size() - 1;
  ASSERT_EQ(model.links()[tip].name, "tip");
  constexpr double kRadius = 0.8;
  double closest = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    std::vector<double> q;
    for (const RobotJoint& joint : model.joints()) {
      q.push_back(Uniform(random, joint.lower, joint.upper));
    }
    std::vector<double> to = q;
    const size_t joint = trial % 2 == 0 ? left : random() % names.size();
    to[joint] += 1e-5;
    const Vector3d point = RandomDirection(random) * kRadius;
    const double moved =
        (model.LinkPoses(to)[tip] * point - model.LinkPoses(q)[tip] * point).norm() / 1e-5;
    ASSERT_LE(moved, chain.LeverOf(joint, tip, kRadius) + 1e-6) << names[joint];
    if (joint == left) closest = std::max(closest, moved / chain.LeverOf(left, tip, kRadius));
  }
  // It slides by as much as `left`, and turns by three times that.
  EXPECT_NEAR(chain.LeverOf(left, tip, kRadius), 1 + 3 * kRadius, 1e-12);
  EXPECT_GT(closest, 0.95);
}

TEST(KinematicChain, ConfigurationsBeyondTheLimitsAreNotContained) {
  const KinematicChain chain =
      Model().ChainOf(std::vector<std::string>{"turn", "slide", "bend"}, {}).value();
  const auto contains = [&](std::vector<double> q) { return chain.Contains(q); };
  EXPECT_TRUE(contains({2, 0.4, 0}));
  EXPECT_TRUE(contains({-2, -0.1, 100}));  // turns without end
  EXPECT_FALSE(contains({0, 0, 1e17}));    // the next number is 16 radians away
  EXPECT_FALSE(contains({2.01, 0, 0}));
  EXPECT_FALSE(contains({0, 0.41, 0}));
  EXPECT_FALSE(contains({0, 0}));
  EXPECT_FALSE(contains({0, 0, std::numeric_limits<double>::quiet_NaN()}));
  EXPECT_FALSE(contains({0, 0, std::numeric_limits<double>::infinity()}));
}

TEST(KinematicChain, JointsThatAreNotThereAndThoseWithoutValueAreNamed) {
  const RobotModel model = Model();
  const auto message = [&](std::vector<std::string> moving, std::vector<FixedJoint> fixed) {
    return std::string(model.ChainOf(moving, fixed).status().message());
  };
  EXPECT_EQ(message({"turn", "bend"}, {}),
            "joint 'slide' of the robot 'r' neither moves nor is fixed");
  EXPECT_EQ(message({"turn", "tilt"}, {}),
            "the robot 'r' has no joint 'tilt'; it has 'turn', 'slide', 'bend'");
}

TEST(KinematicChain, ChainsThatCannotBeAreRefused) {
  EXPECT_THROW(KinematicChain({}, {ChainLink{.parent = 0}}), std::invalid_argument);
  EXPECT_THROW(KinematicChain({}, {ChainLink{}, ChainLink{}}), std::invalid_argument);
  EXPECT_THROW(KinematicChain({}, {ChainLink{}, ChainLink{.parent = 0, .joint = 0}}),
               std::invalid_argument);
  EXPECT_THROW(KinematicChain({{.name = "a", .lower = 1, .upper = 0}}, {ChainLink{}}),
               std::invalid_argument);
  const ChainLink moved{.parent = 0, .joint = 0};
  ChainLink long_axis = moved;
  long_axis.axis *= 2;
  ChainLink slide = moved;
  slide.slides = true;
  const ChainJoint turns{.name = "a", .continuous = true};
  EXPECT_NO_THROW(KinematicChain({turns}, {ChainLink{}, moved}));
  EXPECT_NO_THROW(KinematicChain({{.name = "a"}}, {ChainLink{}, slide}));
  EXPECT_THROW(KinematicChain({turns}, {ChainLink{}, long_axis}), std::invalid_argument);
  EXPECT_THROW(KinematicChain({turns}, {ChainLink{}, slide}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
