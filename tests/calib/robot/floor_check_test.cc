// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/floor_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

#include "db/mask/interpolation.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/random.h"

namespace silhouette {
namespace {

constexpr size_t kForearm = 2;
constexpr size_t kTool = 3;

// A floor for ThreeJoints, all of whose links are about 1 m high while `bend` is 0.
FloorCheck FloorAt(double height, double carried = 0) {
  return {ThreeJoints(), BodyGeometry::kVisual, height, kTool, carried};
}

std::optional<size_t> BelowAt(const FloorCheck& floor, double bend) {
  const std::vector<double> q{0, bend, 0};
  return floor.Below(q, q);
}

TEST(FloorCheck, ABodyBelowTheFloorIsFoundThoughItsOriginIsAbove) {
  EXPECT_EQ(BelowAt(FloorAt(0.98), 0), kForearm);
  EXPECT_EQ(BelowAt(FloorAt(0.96), 0), kTool);
  EXPECT_EQ(BelowAt(FloorAt(0.94), 0), std::nullopt);
}

TEST(FloorCheck, AnOriginBelowTheFloorIsFoundThoughTheLinkHasNoBody) {
  const RobotModel robot =
      RobotModel::FromUrdf(
          WriteFile(FreshFolder() / "bare.urdf",
                    "<robot name='bare'><link name='base'/><link name='arm'/><link name='tip'/>"
                    "<joint name='lift' type='prismatic'><parent link='base'/><child link='arm'/>"
                    "<axis xyz='0 0 1'/><limit lower='0' upper='1' effort='1' velocity='1'/>"
                    "</joint><joint name='end' type='fixed'><parent link='arm'/>"
                    "<child link='tip'/><origin xyz='0 0 -0.2'/></joint></robot>"))
          .value();
  const FloorCheck floor(robot, BodyGeometry::kVisual, 0, 1, 0);
  const std::vector<double> low{0.1};
  const std::vector<double> high{0.3};
  EXPECT_EQ(floor.Below(high, low), 2u);
  EXPECT_EQ(floor.Below(low, high), 2u) << "just after the start";
  EXPECT_EQ(floor.Below(high, high), std::nullopt);
}

TEST(FloorCheck, WhatALinkCarriesIsOfTheLink) {
  EXPECT_EQ(BelowAt(FloorAt(0.85), 0), std::nullopt);
  EXPECT_EQ(BelowAt(FloorAt(0.85, 0.2), 0), kTool);
}

TEST(FloorCheck, LinksThatNoJointRaisesMayBeBelow) {
  // The box of `upper`, which only turns about the vertical, reaches down to 0.9 m.
  EXPECT_EQ(BelowAt(FloorAt(0.95), -1), std::nullopt);
}

TEST(FloorCheck, AWayThatDipsBetweenTwoPlacesAboveTheFloorIsFound) {
  const FloorCheck floor = FloorAt(0.7);
  const std::vector<double> out{0, 0.2, 0};
  const std::vector<double> back_below{0, std::numbers::pi - 0.2, 0};
  const std::vector<double> back_above{0, -std::numbers::pi - 0.2, 0};
  EXPECT_EQ(floor.Below(out, out), std::nullopt);
  EXPECT_EQ(floor.Below(back_below, back_below), std::nullopt);
  EXPECT_NE(floor.Below(out, back_below), std::nullopt);
  EXPECT_EQ(floor.Below(out, back_above), std::nullopt);
}

TEST(FloorCheck, JointValuesThatAreTooFewOrNoNumbersAreRefused) {
  const FloorCheck floor = FloorAt(0);
  const std::vector<double> q{0, 0, 0};
  const std::vector<double> few{0, 0};
  const std::vector<double> none{0, std::numeric_limits<double>::quiet_NaN(), 0};
  EXPECT_THROW(floor.Below(q, few), std::invalid_argument);
  EXPECT_THROW(floor.Below(q, none), std::invalid_argument);
}

// Of all links but the base.
double LowestPoint(const RobotModel& robot, std::span<const double> q) {
  double lowest = std::numeric_limits<double>::infinity();
  const auto base_from_link = robot.LinkPoses(q);
  for (size_t link = 1; link < base_from_link.size(); ++link) {
    lowest = std::min(lowest, base_from_link[link].translation().z());
    for (const LinkGeometry& geometry : robot.links()[link].body()) {
      for (const Eigen::Vector3d& vertex : Tessellate(geometry.shape).vertices) {
        const Eigen::Vector3d point = base_from_link[link] * (geometry.link_from_shape * vertex);
        lowest = std::min(lowest, point.z());
      }
    }
  }
  return lowest;
}

TEST(FloorCheck, NoDipDeeperThanAStepIsMissedAndNoneIsImagined) {
  const RobotModel robot = Gripper();
  Random random;
  const auto any = [&] {
    std::vector<double> q;
    for (const RobotJoint& joint : robot.joints()) {
      q.push_back(std::uniform_real_distribution(joint.lower, joint.upper)(random));
    }
    return q;
  };
  for (int i = 0; i < SampleCount(50); ++i) {
    const std::vector<double> from = any();
    const std::vector<double> to = any();
    constexpr int kPlaces = 400;
    double lowest = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= kPlaces; ++k) {
      const double at = static_cast<double>(k) / kPlaces;
      lowest = std::min(lowest, LowestPoint(robot, Interpolated(from, to, at)));
    }
    const auto below = [&](double floor) {
      return FloorCheck(robot, BodyGeometry::kVisual, floor, 1, 0).Below(from, to).has_value();
    };
    EXPECT_TRUE(below(lowest + kFloorStep + 1e-4));
    EXPECT_FALSE(below(lowest - 1e-4));
  }
}

}  // namespace
}  // namespace silhouette
