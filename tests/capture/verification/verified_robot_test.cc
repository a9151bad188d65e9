// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/verified_robot.h"

#include <gmock/gmock.h>

#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "calib/robot/drawn_digest.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/capture/verification/ball_robot.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kPi = std::numbers::pi;

// A verification of a robot with a joint that turns without end and one with limits.
struct VerifiedRobotTest : ::testing::Test {
  VerifiedRobotTest() {
    cell.robot = std::make_shared<const RobotModel>(ThreeJoints());
    verification.set_digest(DigestOf(bare));
    for (const GridJoint& joint : joints) {
      storage::v1::VerifiedRange& range = *verification.add_ranges();
      range.set_joint(joint.name);
      range.set_lower(joint.lower);
      range.set_upper(joint.upper);
    }
  }

  std::string Unverified() const {
    return VerifiedRobotOf(cell, bare, joints, verification).value().unverified;
  }

  DrawnCell cell;
  DrawnRobot bare = BallRobot({.name = "turn", .lower = -kPi, .upper = kPi, .continuous = true},
                              {.name = "lift", .lower = -2, .upper = 2});
  std::vector<GridJoint> joints = {
      {.name = "turn", .lower = -kPi, .upper = kPi, .steps = 3, .continuous = true},
      {.name = "lift", .lower = 0, .upper = 0.5, .steps = 2}};
  storage::v1::ModelVerification verification;
};

TEST_F(VerifiedRobotTest, VerificationHoldsInItsJointRangesAndNarrowerOnes) {
  EXPECT_THAT(Unverified(), IsEmpty());
  joints[1].lower = 0.1;
  joints[1].upper += 1e-9;
  EXPECT_THAT(Unverified(), IsEmpty()) << "rounded";
  joints[0].lower = 0;
  joints[0].upper = 2 * kPi;
  EXPECT_THAT(Unverified(), IsEmpty()) << "the same turn";
}

TEST_F(VerifiedRobotTest, VerificationIsNoneInAWiderRangeAndBothAreNamed) {
  joints[1].upper = 0.6;
  EXPECT_THAT(Unverified(),
              HasSubstr("its joint 'lift' moves from 0 to 0.6, but only from 0 to 0.5 when"));
  joints[1].upper = 0.5;
  verification.mutable_ranges(0)->set_upper(3);
  EXPECT_THAT(Unverified(), HasSubstr("its joint 'turn' moves from -3.14159 to 3.14159"));
}

TEST_F(VerifiedRobotTest, VerificationWithoutJointRangesIsNone) {
  verification.clear_ranges();
  EXPECT_THAT(Unverified(), HasSubstr("an earlier version compared"));
}

}  // namespace
}  // namespace silhouette
