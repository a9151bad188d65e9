// SPDX-License-Identifier: Apache-2.0
// A robot behind simple_message, against a controller that works and against every way in which one
// fails.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <future>
#include <memory>

#include "absl/time/clock.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "capture/drivers/robots/simple_message_link.h"
#include "capture/sim/served/simple_message_server.h"
#include "capture/sim/served/simulated_controller.h"
#include "tests/capture/drivers/robot_places.h"
#include "tests/capture/sim/small_cell.h"

namespace silhouette {
namespace {

using simple_message::ByteOrder;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pointwise;

class SimpleMessageRobotTest : public testing::Test {
 protected:
  void SetUp() override { Serve({}); }

  void Serve(SimpleMessageServerSettings settings) {
    server_.reset();
    server_ = *SimpleMessageServer::Start(controller_, settings);
    settings_.motion_port = server_->motion_port();
    settings_.state_port = server_->state_port();
    settings_.byte_order = settings.byte_order;
  }

  // A new connection, as a program makes that is started anew.
  std::unique_ptr<FeedbackRobot> Connect(MotionLimits limits = kLimits) const {
    auto link = SimpleMessageLink::Connect(settings_);
    EXPECT_TRUE(link.ok()) << link.status();
    return std::make_unique<FeedbackRobot>(*std::move(link), limits);
  }

  // A robot of such a controller moves there and back.
  void ExpectArrives(ByteOrder order, SimpleMessageSettings::PointMessage point,
                     SimpleMessageSettings::Trajectory trajectory) {
    Serve({.byte_order = order, .joint_feedback = order == ByteOrder::kBig});
    settings_.point = point;
    settings_.trajectory = trajectory;
    const auto robot = Connect();
    EXPECT_THAT(robot->joints(), ElementsAre("turn", "bend", "slide"));
    for (const std::vector<double>& goal : {kThere, kHere}) {
      const absl::Status status = robot->MoveTo(goal);
      ASSERT_TRUE(status.ok()) << status;
      EXPECT_THAT(controller_.state().positions, Pointwise(DoubleNear(kNearRobot), goal));
      const auto state = robot->State();
      ASSERT_TRUE(state.ok()) << state.status();
      EXPECT_THAT(state->positions, Pointwise(DoubleNear(kNearRobot), goal));
      EXPECT_FALSE(state->moving);
    }
    EXPECT_EQ(controller_.stops(), 0);
  }

  // The robot is told to go, and it goes wrong: that is said, and it is told to stop.
  void ExpectStopped(absl::StatusCode code, const std::string& why, MotionLimits limits = kLimits) {
    const auto robot = Connect(limits);
    const absl::Status status = robot->MoveTo(kThere);
    EXPECT_EQ(status.code(), code) << status;
    EXPECT_THAT(status.message(), HasSubstr(why));
    EXPECT_TRUE(Eventually([&] { return controller_.stops() > 0; }));
    EXPECT_TRUE(Eventually([&] { return !controller_.state().moving; }));
  }

  // What a program that is started anew finds.
  void ExpectWorks() {
    controller_.SetFault(ControllerFault::kNone);
    server_->SetFault(ConnectionFault::kNone);
    const auto robot = Connect();
    const absl::Status status = robot->MoveTo(kHere);
    ASSERT_TRUE(status.ok()) << status;
    EXPECT_THAT(controller_.state().positions, Pointwise(DoubleNear(kNearRobot), kHere));
  }

  // Patience that a busy machine does not run out of; those of failing robots are shorter.
  static constexpr MotionLimits kLimits{.joint_speed = 4, .tolerance = 0.002};
  static constexpr MotionLimits kHasty{.joint_speed = 4,
                                       .tolerance = 0.002,
                                       .patience = absl::Milliseconds(300),
                                       .silence = absl::Seconds(1)};

  SimulatedController controller_{ThreeJointRobot(), 0, kHere, [](std::span<const double>) {}};
  std::unique_ptr<SimpleMessageServer> server_;
  SimpleMessageSettings settings_{.host = "127.0.0.1", .joints = {"turn", "bend", "slide"}};
};

TEST_F(SimpleMessageRobotTest, ArrivesInBothByteOrdersWithBothMessagesAndBothKindsOfTrajectory) {
  for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig}) {
    const bool big = order == ByteOrder::kBig;
    ExpectArrives(order, SimpleMessageSettings::PointMessage::kSimple,
                  big ? SimpleMessageSettings::Trajectory::kDownload
                      : SimpleMessageSettings::Trajectory::kStreaming);
  }
}

TEST_F(SimpleMessageRobotTest, ArrivesWithFullPointsInBothKindsOfTrajectory) {
  for (const auto trajectory : {SimpleMessageSettings::Trajectory::kDownload,
                                SimpleMessageSettings::Trajectory::kStreaming}) {
    ExpectArrives(ByteOrder::kLittle, SimpleMessageSettings::PointMessage::kFull, trajectory);
  }
}

TEST_F(SimpleMessageRobotTest, RobotThatReportsTenTimesASecondOrMoreRarelyArrives) {
  for (const absl::Duration period : {absl::Milliseconds(100), absl::Milliseconds(200)}) {
    Serve({.state_period = period});
    settings_.trajectory = SimpleMessageSettings::Trajectory::kDownload;
    const auto robot =
        Connect({.joint_speed = 4, .tolerance = 0.002, .silence = absl::Seconds(20)});
    for (const std::vector<double>& goal : {kThere, kHere}) {
      EXPECT_EQ(robot->MoveTo(goal), absl::OkStatus()) << period;
    }
  }
  EXPECT_EQ(controller_.stops(), 0);
}

TEST_F(SimpleMessageRobotTest, FullPointsAreStoppedOnTheWay) {
  settings_.point = SimpleMessageSettings::PointMessage::kFull;
  controller_.SetFault(ControllerFault::kStopsHalfWay);
  ExpectStopped(absl::StatusCode::kDeadlineExceeded, "did not arrive", kHasty);
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, WrongByteOrderIsSaidWithWhereToChangeIt) {
  Serve({.byte_order = ByteOrder::kBig});
  settings_.byte_order = ByteOrder::kLittle;
  const auto robot = Connect();
  EXPECT_TRUE(Eventually([&] {
    return robot->State().status().message().find("change 'byte_order'") != std::string::npos;
  }));
  EXPECT_FALSE(robot->MoveTo(kThere).ok());
}

TEST_F(SimpleMessageRobotTest, NobodyThereIsSaidWithTheAddress) {
  const int port = server_->state_port();
  server_.reset();
  const absl::Status status = SimpleMessageLink::Connect(settings_).status();
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_THAT(status.message(), HasSubstr(absl::StrCat("127.0.0.1:", port)));
}

TEST_F(SimpleMessageRobotTest, RobotThatDoesNotSetOffIsStopped) {
  controller_.SetFault(ControllerFault::kStaysWhereItIs);
  ExpectStopped(absl::StatusCode::kDeadlineExceeded, "'turn' is 0.5000 from where it should be",
                kHasty);
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, RobotThatStopsHalfWayIsStopped) {
  controller_.SetFault(ControllerFault::kStopsHalfWay);
  ExpectStopped(absl::StatusCode::kDeadlineExceeded, "'turn' is 0.2500 from where it should be",
                kHasty);
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, RobotThatIsTooFastIsStopped) {
  controller_.SetFault(ControllerFault::kTooFast);
  MotionLimits limits = kLimits;
  limits.joint_speed = 0.3;
  ExpectStopped(absl::StatusCode::kAborted, "too fast", limits);
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, EmergencyStopOnTheWayIsTold) {
  controller_.SetFault(ControllerFault::kTripsOnTheWay);
  ExpectStopped(absl::StatusCode::kAborted, "emergency stop");
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, RobotInEmergencyStopIsNotSentOff) {
  controller_.SetFault(ControllerFault::kEmergencyStop);
  const auto robot = Connect();
  const absl::Status status = robot->MoveTo(kThere);
  EXPECT_TRUE(absl::IsAborted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("emergency stop"));
}

TEST_F(SimpleMessageRobotTest, RobotThatMovesByItselfIsStoppedThoughNobodyAsks) {
  const auto robot = Connect();
  ASSERT_TRUE(robot->MoveTo(kThere).ok());
  EXPECT_EQ(controller_.stops(), 0);
  controller_.SetFault(ControllerFault::kDrifts);
  ASSERT_TRUE(Eventually([&] { return controller_.stops() > 0; }));
  EXPECT_TRUE(Eventually([&] { return !controller_.state().moving; }));
  for (const absl::Status& status : {robot->State().status(), robot->MoveTo(kHere)}) {
    EXPECT_TRUE(absl::IsAborted(status)) << status;
    EXPECT_THAT(status.message(), HasSubstr("moves when it should stand still: 'turn'"));
  }
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, ConnectionThatIsClosedOnTheWayStopsTheRobotOverANewOne) {
  const auto robot = Connect({.joint_speed = 0.2});
  std::future<absl::Status> move =
      std::async(std::launch::async, [&] { return robot->MoveTo(kThere); });
  ASSERT_TRUE(Eventually([&] { return controller_.state().moving; }));
  server_->SetFault(ConnectionFault::kClosed);
  const absl::Status status = move.get();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_GT(controller_.stops(), 0);
  EXPECT_FALSE(controller_.state().moving);
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, MotionConnectionThatIsClosedIsALossOnlyOnTheWay) {
  auto motion = *SimpleMessageServer::Start(controller_, {});
  settings_.motion_port = motion->motion_port();
  auto robot = Connect();
  ASSERT_TRUE(robot->MoveTo(kThere).ok());
  ASSERT_TRUE(Eventually([&] { return robot->State().ok() && !robot->State()->moving; }));
  motion.reset();
  for (int i = 0; i < 30; ++i) {
    absl::SleepFor(absl::Milliseconds(10));
    ASSERT_EQ(robot->State().status(), absl::OkStatus());
  }

  motion = *SimpleMessageServer::Start(controller_, {});
  settings_.motion_port = motion->motion_port();
  robot = Connect({.joint_speed = 0.05});
  std::future<absl::Status> move =
      std::async(std::launch::async, [&] { return robot->MoveTo(kHere); });
  ASSERT_TRUE(Eventually([&] { return robot->State().ok() && robot->State()->moving; }));
  motion.reset();
  const absl::Status status = move.get();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
}

TEST_F(SimpleMessageRobotTest, SilenceOnTheWayStopsTheRobot) {
  for (const ConnectionFault fault :
       {ConnectionFault::kSilent, ConnectionFault::kHalf, ConnectionFault::kGarbage}) {
    Serve({});
    MotionLimits limits{.joint_speed = 0.05};
    limits.silence = absl::Milliseconds(400);
    const auto robot = Connect(limits);
    const int stops = controller_.stops();
    std::future<absl::Status> move =
        std::async(std::launch::async, [&] { return robot->MoveTo(kThere); });
    ASSERT_TRUE(Eventually([&] { return controller_.state().moving; }));
    server_->SetFault(fault);
    const absl::Status status = move.get();
    EXPECT_EQ(status.code(), fault == ConnectionFault::kGarbage ? absl::StatusCode::kDataLoss
                                                                : absl::StatusCode::kUnavailable)
        << status;
    EXPECT_GT(controller_.stops(), stops);
    EXPECT_FALSE(controller_.state().moving);
  }
  Serve({});
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, ConnectionsThatCarryNothingStopTheRobotOverANewOne) {
  const auto robot = Connect({.joint_speed = 0.05});
  std::future<absl::Status> move =
      std::async(std::launch::async, [&] { return robot->MoveTo(kThere); });
  ASSERT_TRUE(Eventually([&] { return controller_.state().moving; }));
  server_->SetFault(ConnectionFault::kDead);
  const absl::Status status = move.get();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_GT(controller_.stops(), 0) << status;
  EXPECT_FALSE(controller_.state().moving);
  ExpectWorks();
}

TEST_F(SimpleMessageRobotTest, RobotThatWasSwitchedOffAndOnIsFoundAgain) {
  const auto robot = Connect();
  ASSERT_TRUE(robot->MoveTo(kThere).ok());
  server_->SetFault(ConnectionFault::kDead);
  ASSERT_TRUE(Eventually([&] { return !robot->State().ok(); }));
  EXPECT_TRUE(Eventually([&] { return robot->State().ok(); }));
  EXPECT_TRUE(Eventually([&] { return robot->MoveTo(kHere).ok(); }));
}

TEST_F(SimpleMessageRobotTest, SilenceThatNobodyNoticedIsToldOnce) {
  const auto robot = Connect({.joint_speed = 4, .silence = absl::Milliseconds(300)});
  ASSERT_TRUE(Eventually([&] { return robot->State().ok(); }));
  server_->SetFault(ConnectionFault::kSilent);
  absl::SleepFor(absl::Milliseconds(600));
  server_->SetFault(ConnectionFault::kNone);
  absl::SleepFor(absl::Milliseconds(100));
  const absl::Status lost = robot->MoveTo(kThere);
  EXPECT_TRUE(absl::IsUnavailable(lost)) << lost;
  EXPECT_THAT(lost.message(), HasSubstr("lost"));
  EXPECT_THAT(controller_.state().positions, Pointwise(DoubleNear(kNearRobot), kHere));
  EXPECT_TRUE(Eventually([&] { return robot->State().ok(); }));
  EXPECT_TRUE(Eventually([&] { return robot->MoveTo(kThere).ok(); }));
}

TEST_F(SimpleMessageRobotTest, StopFromAnotherThreadEndsTheMove) {
  const auto robot = Connect({.joint_speed = 0.05});
  std::future<absl::Status> move =
      std::async(std::launch::async, [&] { return robot->MoveTo(kThere); });
  ASSERT_TRUE(Eventually([&] { return controller_.state().moving; }));
  EXPECT_TRUE(robot->Stop().ok());
  const absl::Status status = move.get();
  EXPECT_TRUE(absl::IsAborted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("stopped on the way"));
  EXPECT_FALSE(controller_.state().moving);
}

TEST_F(SimpleMessageRobotTest, GoalBeyondALimitIsRefusedByTheController) {
  const absl::Status status = Connect()->MoveTo(std::vector<double>{2.5, 0, 0});
  EXPECT_TRUE(absl::IsAborted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("refuses to move"));
}

TEST_F(SimpleMessageRobotTest, WrongNumberOfJointsIsAMistake) {
  EXPECT_TRUE(absl::IsInvalidArgument(Connect()->MoveTo(std::vector<double>{0, 0})));
}

}  // namespace
}  // namespace silhouette
