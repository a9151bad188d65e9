// SPDX-License-Identifier: Apache-2.0
// A robot that a person moves: what he is told, what he may answer.
#include "capture/drivers/robots/manual_robot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <deque>
#include <functional>
#include <numbers>
#include <stdexcept>

#include "absl/time/time.h"

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

// The operator's end of a terminal, at which another process asks him.
class Terminal {
 public:
  // `work`: what the process does; its exit code.
  explicit Terminal(const std::function<int()>& work) {
    child_ = forkpty(&end_, nullptr, nullptr, nullptr);
    if (child_ == 0) _exit(work());
    if (child_ < 0) throw std::runtime_error("no terminal");
  }
  ~Terminal() {
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
    close(end_);
  }

  // Waits until it has shown `text` that many times.
  bool Shows(const std::string& text, int times) {
    while (Count(text) < times) {
      if (!ReadSome(absl::Seconds(60))) return false;
    }
    return true;
  }
  // Reads what it shows within `time`; false: nothing.
  bool ReadSome(absl::Duration time) {
    pollfd ready{.fd = end_, .events = POLLIN, .revents = 0};
    if (poll(&ready, 1, static_cast<int>(absl::ToInt64Milliseconds(time))) <= 0) return false;
    char bytes[4096];
    const ssize_t length = read(end_, bytes, sizeof(bytes));
    ended_ = length <= 0;  // EIO: it has ended
    if (!ended_) shown_.append(bytes, static_cast<size_t>(length));
    return !ended_;
  }
  void Type(const std::string& text) const {
    EXPECT_EQ(write(end_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  bool ended() const { return ended_; }

 private:
  int Count(const std::string& text) const {
    int count = 0;
    for (size_t at = shown_.find(text); at != std::string::npos; at = shown_.find(text, at + 1)) {
      ++count;
    }
    return count;
  }

  int end_ = -1;
  pid_t child_ = 0;
  bool ended_ = false;
  std::string shown_;
};

TEST(OperatorAtTerminal, SecondEnterOfTwoDoesNotConfirmTheNextConfiguration) {
  Terminal terminal([] {
    ManualRobot robot(Joints(), OperatorAtTerminal(), ManualRobot::Reading::kConfirmed);
    const bool moved = robot.MoveTo(std::vector<double>{0, 0}).ok() &&
                       robot.MoveTo(std::vector<double>{1, 0}).ok();
    return moved ? 0 : 1;
  });
  ASSERT_TRUE(terminal.Shows("or stop: ", 1));
  terminal.Type("\n\n");
  ASSERT_TRUE(terminal.Shows("or stop: ", 2));
  while (terminal.ReadSome(absl::Milliseconds(300))) {
  }
  EXPECT_FALSE(terminal.ended()) << "it waits for an answer";
  terminal.Type("\n");
  while (terminal.ReadSome(absl::Seconds(60))) {
  }
  EXPECT_TRUE(terminal.ended());
}

TEST(OperatorAtTerminal, QuestionOfABackgroundJobDoesNotStopIt) {
  Terminal terminal([] {
    const pid_t job = fork();
    if (job != 0) return static_cast<int>(waitpid(job, nullptr, 0));
    setpgid(0, 0);
    return OperatorAtTerminal().ask("where? ").ok() ? 0 : 1;
  });
  EXPECT_TRUE(terminal.Shows("where? ", 1));
}

}  // namespace
}  // namespace silhouette
