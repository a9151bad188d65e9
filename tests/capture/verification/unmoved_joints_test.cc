// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/unmoved_joints.h"

#include <gmock/gmock.h>

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

}  // namespace
}  // namespace silhouette
