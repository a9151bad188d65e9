// SPDX-License-Identifier: Apache-2.0
#include "server/live/joint_history.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace silhouette {
namespace {

using ::testing::HasSubstr;

absl::Duration Ms(int milliseconds) { return absl::Milliseconds(milliseconds); }

// Joints "a" and, continuous, "b"; no waiting.
struct JointHistoryTest : ::testing::Test {
  JointHistory history{{.gap = Ms(100), .max_movement = 0.01}, {false, true}};

  void Told(int at, double a, double b = 0) {
    ASSERT_TRUE(history.Add(Ms(at), Ms(at + 1), std::vector<double>{a, b}).ok());
  }
  absl::StatusOr<std::vector<JointHistory::Range>> Between(int first, int last) {
    return history.Between(Ms(first), Ms(last), absl::ZeroDuration());
  }
  absl::StatusCode CodeOf(int first, int last) { return Between(first, last).status().code(); }
};

TEST_F(JointHistoryTest, JointsAreThoseAroundTheImages) {
  Told(10, 1.000);
  Told(20, 1.004);
  Told(30, 1.008);
  Told(40, 5);
  const auto joints = Between(15, 29);
  ASSERT_TRUE(joints.ok()) << joints.status();
  EXPECT_NEAR((*joints)[0].middle, 1.004, 1e-12);
  EXPECT_NEAR((*joints)[0].half, 0.004, 1e-12);
}

TEST_F(JointHistoryTest, RobotThatMovedMoreThanItMayIsNowhere) {
  Told(10, 1.000);
  Told(20, 1.011);
  const auto joints = Between(15, 16);
  EXPECT_EQ(joints.status().code(), absl::StatusCode::kAborted);
  EXPECT_THAT(std::string(joints.status().message()), HasSubstr("max_joint_movement"));
}

TEST_F(JointHistoryTest, WhatMovedAndCameBackHasMoved) {
  Told(10, 1);
  Told(20, 1.5);
  Told(30, 1);
  EXPECT_EQ(CodeOf(15, 25), absl::StatusCode::kAborted);
}

TEST_F(JointHistoryTest, FullTurnsOfAContinuousJointAreNoMovement) {
  Told(10, 1, std::numbers::pi - 0.001);
  Told(20, 1, -std::numbers::pi + 0.001);
  const auto joints = Between(15, 16);
  ASSERT_TRUE(joints.ok()) << joints.status();
  EXPECT_NEAR(std::remainder((*joints)[1].middle - std::numbers::pi, 2 * std::numbers::pi), 0,
              1e-12);
}

TEST_F(JointHistoryTest, AnswerThatWasUnderWayCountsNeitherBeforeNorAfter) {
  Told(10, 1);
  ASSERT_TRUE(history.Add(Ms(14), Ms(17), std::vector<double>{1, 0}).ok());
  EXPECT_EQ(CodeOf(15, 16), absl::StatusCode::kDeadlineExceeded) << "none was asked for after 16";
  Told(20, 1);
  EXPECT_TRUE(Between(15, 16).ok());
}

TEST_F(JointHistoryTest, JointsThatWereNotToldNearTheImagesAreUnknown) {
  EXPECT_EQ(CodeOf(15, 16), absl::StatusCode::kUnavailable);
  Told(10, 1);
  EXPECT_EQ(CodeOf(111, 112), absl::StatusCode::kUnavailable) << "too long before";
  Told(300, 1);
  EXPECT_EQ(CodeOf(12, 13), absl::StatusCode::kDeadlineExceeded) << "too long after";
  EXPECT_EQ(CodeOf(5, 8), absl::StatusCode::kUnavailable) << "images before all joints";
}

TEST_F(JointHistoryTest, RobotThatFailsIsToldAsItsFault) {
  Told(10, 1);
  history.Fail(absl::UnavailableError("the controller is gone"));
  EXPECT_EQ(Between(15, 16).status(), absl::UnavailableError("the controller is gone"));
  Told(20, 1);
  EXPECT_TRUE(Between(15, 16).ok());
}

TEST_F(JointHistoryTest, AnswersThatAreNoPositionsAreErrors) {
  EXPECT_FALSE(history.Add(Ms(1), Ms(2), std::vector<double>{1}).ok());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(history.Add(Ms(1), Ms(2), std::vector<double>{1, nan}).ok());
  EXPECT_FALSE(Between(3, 4).ok());
}

TEST_F(JointHistoryTest, OldAnswersAreForgottenAndNewOnesStay) {
  for (int at = 0; at < 100'000; at += 50) Told(at, 1);
  EXPECT_TRUE(Between(99'905, 99'920).ok());
  EXPECT_FALSE(Between(101, 102).ok());
}

}  // namespace
}  // namespace silhouette
