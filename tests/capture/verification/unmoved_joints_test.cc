// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/unmoved_joints.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <numbers>
#include <string>
#include <vector>

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kDeg = std::numbers::pi / 180;

struct UnmovedJointsTest : ::testing::Test {
  // Of a chain of one joint.
  std::vector<std::string> Unmoved(const std::vector<double>& values) const {
    const KinematicChain chain({{.name = joint.name, .lower = joint.lower, .upper = joint.upper}},
                               {ChainLink{}, {.parent = 0, .joint = 0, .slides = slides}});
    std::vector<ModelSample> samples;
    for (const double value : values) samples.push_back({.q = {value}, .captured = {}});
    return UnmovedJoints(chain, std::vector<GridJoint>{joint}, samples, 0.5);
  }

  GridJoint joint{.name = "axis", .lower = -100 * kDeg, .upper = 100 * kDeg};
  bool slides = false;
};

TEST_F(UnmovedJointsTest, MovedThroughTheShareOfTheirRange) {
  EXPECT_THAT(Unmoved({-40 * kDeg, 20 * kDeg, 61 * kDeg}), IsEmpty());
  EXPECT_THAT(Unmoved({-40 * kDeg, 20 * kDeg, 59 * kDeg}),
              ElementsAre(HasSubstr("joint 'axis' moved through only 99.0 deg of 200.0 deg, less "
                                    "than least_moved, 50 %")));
}

TEST_F(UnmovedJointsTest, OfARangeOfTurnsMustMoveThroughTheShareOfOne) {
  joint.lower = -360 * kDeg;
  joint.upper = 360 * kDeg;
  EXPECT_THAT(Unmoved({-190 * kDeg, -90 * kDeg, 0}), IsEmpty());
}

TEST_F(UnmovedJointsTest, WholeTurnsAreNoMotion) {
  joint.lower = -180 * kDeg;
  joint.upper = 180 * kDeg;
  EXPECT_THAT(Unmoved({-179 * kDeg, 179 * kDeg, -180 * kDeg}),
              ElementsAre(HasSubstr("only 2.0 deg of 360.0 deg")));
}

TEST_F(UnmovedJointsTest, ThatSlideAreMeasuredInMillimetres) {
  slides = true;
  joint.lower = 0;
  joint.upper = 9;
  EXPECT_THAT(Unmoved({0.5, 7}), IsEmpty());
  EXPECT_THAT(Unmoved({0.5, 2}), ElementsAre(HasSubstr("only 1500.0 mm of 9000.0 mm")));
}

// A body on a joint whose axis points at the camera.
struct UndirectedJointsTest : ::testing::Test {
  std::vector<std::string> Undirected(const std::vector<double>& degrees) const {
    const CameraIntrinsics in{
        .width = 64, .height = 64, .fx = 66, .fy = 66, .cx = 31.5, .cy = 31.5, .distortion = {}};
    Eigen::Isometry3d down(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
    down.pretranslate(Eigen::Vector3d(0, 0, 3));
    const DrawnRobot robot(
        KinematicChain({{.name = "axis", .lower = joint.lower, .upper = joint.upper}},
                       {ChainLink{}, {.parent = 0, .joint = 0, .slides = slides}}),
        {{.link = 1, .moves_with = 1, .points = body, .radius = 0.05, .inner = {}}},
        {PartDrawer(CameraModel(in, down.inverse()), MaskSize{64, 64})});
    std::vector<ModelSample> samples;
    for (const double value : degrees) samples.push_back({.q = {value * kDeg}, .captured = {}});
    return UndirectedJoints(robot, robot, std::vector<GridJoint>{joint}, samples);
  }

  GridJoint joint{.name = "axis", .lower = -180 * kDeg, .upper = 180 * kDeg};
  bool slides = false;
  // A bar; of two points.
  Eigen::Matrix3Xd body = (Eigen::Matrix3Xd(3, 2) << -0.4, 0.4, 0, 0, 0, 0).finished();
};

TEST_F(UndirectedJointsTest, BarAtQuarterTurnsLooksTheSameWhicheverWayItTurns) {
  EXPECT_THAT(Undirected({-180, -90, 0, 90}),
              ElementsAre(HasSubstr("joint 'axis': at all its captured values")));
  EXPECT_THAT(Undirected({-180, -90, 0, 90, 30}), IsEmpty());
}

TEST_F(UndirectedJointsTest, WhatNeverShowsIsNoMatter) {
  body = Eigen::Vector3d(0, 0, 0.1);
  EXPECT_THAT(Undirected({-180, -90, 0, 90}), IsEmpty()) << "round";
  body = Eigen::Vector3d(0.3, 0, 0.1);
  EXPECT_THAT(Undirected({-180, 0}), ElementsAre(HasSubstr("may be reversed")));
  slides = true;
  EXPECT_THAT(Undirected({-180, 0}), IsEmpty());
}

}  // namespace
}  // namespace silhouette
