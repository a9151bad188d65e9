// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/robots/feedback_robot.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"

namespace silhouette {
namespace {

// A controller that reports when the test says so.
class ReportingLink : public ControllerLink {
 public:
  explicit ReportingLink(Observer& observer) : observer_(observer) {}

  const std::vector<std::string>& joints() const override { return joints_; }
  void Start(Observer observer) override { observer_ = std::move(observer); }
  absl::Status Move(std::span<const double>, absl::Duration) override { return absl::OkStatus(); }
  absl::Status Stop() override { return absl::OkStatus(); }

 private:
  const std::vector<std::string> joints_ = {"turn"};
  Observer& observer_;
};

TEST(FeedbackRobot, PositionsThatWereHeldUpAreNotTakenForNew) {
  ControllerLink::Observer controller;
  FeedbackRobot robot(std::make_unique<ReportingLink>(controller), {.joint_speed = 1});
  for (int i = 0; i < 64; ++i) {
    controller.feedback({.positions = {0}});
    absl::SleepFor(absl::Milliseconds(2));
  }
  absl::SleepFor(absl::Milliseconds(500));
  const absl::Duration held_up = RunningNow();
  for (int i = 0; i < 10; ++i) controller.feedback({.positions = {0}});
  const auto state = robot.State();
  ASSERT_TRUE(state.ok()) << state.status();
  ASSERT_TRUE(state->not_before.has_value());
  EXPECT_LT(*state->not_before, held_up - absl::Milliseconds(200));
}

}  // namespace
}  // namespace silhouette
