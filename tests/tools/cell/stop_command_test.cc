// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/devices/stop_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>
#include <string>
#include <vector>

namespace silhouette {
namespace {

using testing::HasSubstr;

class StoppedRobot : public Robot {
 public:
  explicit StoppedRobot(absl::Status stopped) : stopped_(std::move(stopped)) {}
  const std::vector<std::string>& joints() const override { return joints_; }
  absl::Status MoveTo(std::span<const double>) override { return absl::OkStatus(); }
  absl::StatusOr<RobotState> State() override { return RobotState{}; }
  absl::Status Stop() override {
    ++stops_;
    return stopped_;
  }
  int stops() const { return stops_; }

 private:
  const std::vector<std::string> joints_;
  const absl::Status stopped_;
  int stops_ = 0;
};

// What is said.
std::string Halt(StoppedRobot& robot) {
  testing::internal::CaptureStderr();
  StopCommandTo(robot)();
  return testing::internal::GetCapturedStderr();
}

TEST(StopCommand, IsRepeatedForAMoveThatWasJustBeingSent) {
  StoppedRobot robot{absl::OkStatus()};
  EXPECT_EQ(Halt(robot), "\nthe robot received a stop command\n");
  EXPECT_EQ(robot.stops(), 2);
}

TEST(StopCommand, IsNotRepeatedForARobotThatDoesNotAnswer) {
  for (const absl::Status& status :
       {absl::UnavailableError("no answer"), absl::DeadlineExceededError("no answer")}) {
    StoppedRobot robot{status};
    EXPECT_THAT(Halt(robot), HasSubstr("the stop command to the robot failed: no answer"));
    EXPECT_EQ(robot.stops(), 1);
  }
}

}  // namespace
}  // namespace silhouette
