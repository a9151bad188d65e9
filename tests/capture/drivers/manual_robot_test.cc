// SPDX-License-Identifier: Apache-2.0
// A robot that a person moves: what he is told, what he may answer.
#include "capture/drivers/robots/manual_robot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <numbers>

namespace silhouette {
namespace {

using testing::AllOf;
using testing::DoubleEq;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double kDegree = std::numbers::pi / 180;

// Answers in turn what he was given.
class Person {
 public:
  explicit Person(std::deque<std::string> answers) : answers_(std::move(answers)) {}

  Operator AsOperator() {
    return {.tell = [this](const std::string& line) { told.push_back(line); },
            .ask = [this](const std::string& question) -> absl::StatusOr<std::string> {
              told.push_back(question);
              if (answers_.empty()) return absl::FailedPreconditionError("nobody is there");
              std::string answer = answers_.front();
              answers_.pop_front();
              return answer;
            }};
  }

  std::vector<std::string> told;

 private:
  std::deque<std::string> answers_;
};

std::vector<ManualJoint> Joints() {
  return {{.name = "turn"}, {.name = "rail", .prismatic = true}};
}

TEST(ManualRobot, IsWhereTheOperatorConfirmsIt) {
  Person person({"0 0", ""});
  ManualRobot robot(Joints(), person.AsOperator(), ManualRobot::Reading::kConfirmed);
  EXPECT_THAT(robot.joints(), ElementsAre("turn", "rail"));
  EXPECT_THAT(robot.State()->positions, ElementsAre(0, 0));
  ASSERT_TRUE(robot.MoveTo(std::vector<double>{30 * kDegree, 0.12}).ok());
  EXPECT_THAT(person.told,
              ElementsAre(HasSubstr("where does the robot stand?"),
                          HasSubstr("move the robot to: turn 30.00 deg, rail 120.00 mm"),
                          HasSubstr("Enter when it stands there")));
  EXPECT_THAT(robot.State()->positions, ElementsAre(DoubleEq(30 * kDegree), 0.12));
}

TEST(ManualRobot, OnlyWhatChangesIsTold) {
  Person person({"30 120", ""});
  ManualRobot robot(Joints(), person.AsOperator(), ManualRobot::Reading::kConfirmed);
  ASSERT_TRUE(robot.State().ok());
  ASSERT_TRUE(robot.MoveTo(std::vector<double>{30 * kDegree, 0.2}).ok());
  EXPECT_THAT(person.told[1], AllOf(HasSubstr("rail 200.00 mm"), HasSubstr("the other joints stay"),
                                    Not(HasSubstr("turn"))));
}

TEST(ManualRobot, IsWhereTheValuesSayThatHeTypes) {
  Person person({"much", "1", "30.01, 119.9"});
  ManualRobot robot(Joints(), person.AsOperator(), ManualRobot::Reading::kConfirmed);
  ASSERT_TRUE(robot.MoveTo(std::vector<double>{30 * kDegree, 0.12}).ok());
  EXPECT_THAT(person.told[2], HasSubstr("not understood: 2 numbers are expected, for turn, rail"));
  EXPECT_THAT(robot.State()->positions,
              ElementsAre(DoubleNear(30.01 * kDegree, 1e-12), DoubleNear(0.1199, 1e-12)));
}

TEST(ManualRobot, ConfirmingIsNotEnoughWhereHeMustType) {
  Person person({"", "30 120"});
  ManualRobot robot(Joints(), person.AsOperator(), ManualRobot::Reading::kTyped);
  ASSERT_TRUE(robot.MoveTo(std::vector<double>{30 * kDegree, 0.12}).ok());
  EXPECT_THAT(person.told[2], HasSubstr("not understood"));
}

TEST(ManualRobot, StopAndNobodyThereAreErrors) {
  Person person({" Stop "});
  ManualRobot robot(Joints(), person.AsOperator(), ManualRobot::Reading::kConfirmed);
  EXPECT_TRUE(absl::IsCancelled(robot.MoveTo(std::vector<double>{0, 0})));
  EXPECT_TRUE(absl::IsFailedPrecondition(robot.MoveTo(std::vector<double>{0, 0})));
  EXPECT_TRUE(absl::IsFailedPrecondition(robot.State().status()));
  EXPECT_TRUE(absl::IsInvalidArgument(robot.MoveTo(std::vector<double>{0})));
  EXPECT_TRUE(robot.Stop().ok());
  EXPECT_EQ(person.told.back(), "do not move the robot any more");
}

// Tells what it is given, in turn; the last again and again.
class Reader : public Robot {
 public:
  explicit Reader(std::deque<std::vector<double>> states) : states_(std::move(states)) {}
  const std::vector<std::string>& joints() const override { return names_; }
  absl::Status MoveTo(std::span<const double>) override { return absl::InternalError("it reads"); }
  absl::Status Stop() override { return absl::OkStatus(); }
  absl::StatusOr<RobotState> State() override {
    RobotState state{.positions = states_.front(), .moving = false};
    if (states_.size() > 1) states_.pop_front();
    return state;
  }

 private:
  std::vector<std::string> names_ = {"turn", "rail"};
  std::deque<std::vector<double>> states_;
};

TEST(ManualRobot, WhatIsReadDecidesAndHeIsToldByHowMuchItIsOff) {
  Person person({"", "", ""});
  auto reader = std::make_unique<Reader>(std::deque<std::vector<double>>{
      {0.1 * kDegree, 0.1}, {1 * kDegree, 0.1205}, {1 * kDegree, 0.12}});
  ManualRobot robot(Joints(), person.AsOperator(), std::move(reader), 0.0002);
  ASSERT_TRUE(robot.MoveTo(std::vector<double>{1 * kDegree, 0.12}).ok());
  EXPECT_THAT(person.told[2], HasSubstr("it is off: turn by -0.900 deg, rail by -20.000 mm"));
  EXPECT_THAT(person.told[4], HasSubstr("it is off: rail by 0.500 mm"));
  EXPECT_THAT(robot.State()->positions, ElementsAre(DoubleEq(1 * kDegree), 0.12));
}

}  // namespace
}  // namespace silhouette
