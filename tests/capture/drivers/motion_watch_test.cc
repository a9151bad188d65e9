// SPDX-License-Identifier: Apache-2.0
// What is believed of a robot on its way, with a clock of the test's own; and of a robot that
// states its angles from -pi to pi.
#include "capture/drivers/robots/motion_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <mutex>
#include <numbers>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "capture/devices/joint_deviation.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "tests/capture/drivers/robot_places.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

constexpr absl::Duration kPeriod = absl::Milliseconds(20);

class MotionWatchTest : public testing::Test {
 protected:
  static constexpr MotionLimits kLimits{
      .joint_speed = 0.5, .tolerance = 0.002, .patience = absl::Seconds(3)};

  // A robot whose joints are at `at` of the time tells so every kPeriod, for `time` at most: until
  // it has arrived or must be stopped.
  absl::Status Follow(const std::function<RobotFeedback(double seconds)>& at, absl::Duration time) {
    for (; now_ - begin_ <= time; now_ += kPeriod) {
      absl::Status status = watch_.Tell(now_, at(absl::ToDoubleSeconds(now_ - begin_)));
      if (status.ok()) status = watch_.CheckTime(now_);
      if (!status.ok() || watch_.arrived()) return status;
    }
    return absl::OkStatus();
  }

  absl::Duration begin_ = absl::Seconds(50);
  absl::Duration now_ = begin_;
  MotionWatch watch_{{"turn", "lift"}, {0, 0}, {1, -0.5}, kLimits, begin_};
};

RobotFeedback At(double turn, double lift) { return {.positions = {turn, lift}}; }
// On the straight way, `share` of it.
RobotFeedback OnTheWay(double share) { return At(share, -0.5 * share); }

TEST_F(MotionWatchTest, RobotThatStandsAtItsGoalHasArrived) {
  EXPECT_EQ(watch_.duration(), absl::Seconds(2));
  const auto even = [](double s) { return OnTheWay(std::min(s / 2, 1.0)); };
  ASSERT_TRUE(Follow(even, absl::Seconds(4)).ok());
  EXPECT_TRUE(watch_.arrived());
  EXPECT_GE(now_ - begin_, absl::Seconds(2) + Stillness::kMoment - kPeriod);
  EXPECT_LE(now_ - begin_, absl::Seconds(2.3));
}

TEST(MotionWatch, RobotThatReportsRarelyArrivesOnceThreeReportsAreAlike) {
  for (const int period : {79, 80, 100, 200, 400}) {
    const absl::Duration pause = absl::Milliseconds(period);
    MotionWatch watch({"turn"}, {0}, {0.5}, {}, absl::ZeroDuration());
    absl::Duration now;
    absl::Status status;
    for (; status.ok() && !watch.arrived() && now < absl::Seconds(20); now += pause) {
      status = watch.Tell(now, {.positions = {std::min(0.5, absl::ToDoubleSeconds(now) / 2)}});
      if (status.ok()) status = watch.CheckTime(now);
    }
    EXPECT_EQ(status, absl::OkStatus()) << pause;
    EXPECT_TRUE(watch.arrived()) << pause;
    EXPECT_GE(now, absl::Seconds(1) + 2 * pause);
    EXPECT_LE(now, absl::Seconds(1) + 4 * pause + Stillness::kMoment);
  }
}

TEST_F(MotionWatchTest, RobotThatPassesItsGoalHasNotArrived) {
  // Within the tolerance for one message only.
  const auto swing = [](double s) { return s < 2 ? OnTheWay(s / 2) : At(1 + (s - 2) * 0.1, -0.5); };
  ASSERT_TRUE(Follow(swing, absl::Seconds(2.1)).ok());
  EXPECT_FALSE(watch_.arrived());
}

TEST_F(MotionWatchTest, RobotThatSaysItMovesHasNotArrived) {
  const auto at_goal = [](double s) {
    RobotFeedback feedback = OnTheWay(std::min(s / 2, 1.0));
    feedback.moving = true;
    return feedback;
  };
  const absl::Status status = Follow(at_goal, absl::Seconds(10));
  EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("does not come to rest"));
}

TEST_F(MotionWatchTest, RobotThatTremblesHasNotArrived) {
  const auto tremble = [](double s) {
    return s < 2 ? OnTheWay(s / 2) : At(1 + 0.0019 * std::cos(100 * s), -0.5);
  };
  EXPECT_TRUE(absl::IsDeadlineExceeded(Follow(tremble, absl::Seconds(10))));
  EXPECT_FALSE(watch_.arrived());
}

TEST_F(MotionWatchTest, RobotThatStaysOrStopsHalfWayIsSaidToWithItsWorstJoint) {
  const auto half = [](double s) { return OnTheWay(std::min(s / 2, 0.5)); };
  const absl::Status status = Follow(half, absl::Seconds(60));
  EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("not moved on for"));
  EXPECT_THAT(status.message(), HasSubstr("'turn' is 0.5000 from where it should be"));
  EXPECT_LE(now_ - begin_, absl::Seconds(4.2)) << "half of the way and the patience";
}

TEST_F(MotionWatchTest, RobotThatCreepsIsNotWaitedForLongerThanTwiceTheTime) {
  const auto creep = [](double s) { return OnTheWay(0.05 * s); };
  EXPECT_TRUE(absl::IsDeadlineExceeded(Follow(creep, absl::Seconds(60))));
  EXPECT_LE(now_ - begin_, absl::Seconds(7.1));
}

TEST_F(MotionWatchTest, RobotThatIsMuchTooFastIsStopped) {
  const auto fast = [](double s) { return OnTheWay(std::min(5 * s, 1.0)); };
  const absl::Status status = Follow(fast, absl::Seconds(10));
  EXPECT_TRUE(absl::IsAborted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("too fast: 'turn'"));
  EXPECT_LE(now_ - begin_, absl::Seconds(0.1));
}

TEST_F(MotionWatchTest, SlowStartAndEndAreNotTooFast) {
  const auto smooth = [](double s) {
    const double t = std::min(s / 2, 1.0);
    return OnTheWay(t * t * t * (10 + t * (6 * t - 15)));
  };
  EXPECT_TRUE(Follow(smooth, absl::Seconds(10)).ok());
  EXPECT_TRUE(watch_.arrived());
}

TEST_F(MotionWatchTest, JointThatLeavesItsWayIsStopped) {
  // As if the joints were taken for each other.
  const auto swapped = [](double s) { return At(-0.25 * s, 0.5 * s); };
  const absl::Status status = Follow(swapped, absl::Seconds(10));
  EXPECT_TRUE(absl::IsAborted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("leaves its way"));
  EXPECT_LE(now_ - begin_, absl::Seconds(0.1));
}

TEST_F(MotionWatchTest, FaultsAndNonsenseStop) {
  EXPECT_THAT(watch_.Tell(now_, {.positions = {0, 0}, .fault = "emergency stop"}).message(),
              HasSubstr("emergency stop"));
  const absl::Status status = watch_.Tell(now_, At(0, std::nan("")));
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("position of 'lift' that is not a number"));
}

constexpr double kPi = std::numbers::pi;

// As a controller that states angles from -pi to pi.
double Wrapped(double angle) { return std::remainder(angle, 2 * kPi); }

TEST(JointDeviation, FullTurnsDoNotCountOnContinuousJointsOnly) {
  const std::vector<double> from = {-kPi, -kPi};
  const std::vector<double> to = {kPi + 0.1, -kPi + 0.2};
  EXPECT_EQ(GreatestDeviation(from, to, {true, false}).joint, 1u);
  EXPECT_NEAR(GreatestDeviation(from, to, {true}).deviation, 0.2, 1e-12);
  EXPECT_NEAR(GreatestDeviation(from, to, {false, true}).deviation, 2 * kPi + 0.1, 1e-12);
  EXPECT_EQ(GreatestDeviation(from, to).joint, 0u);
  EXPECT_EQ(GreatestDeviation(from, std::vector<double>{-kPi, std::nan("")}, {true, true}).joint,
            1u);
  EXPECT_EQ(GreatestDeviation(from, std::vector<double>{INFINITY, 0}, {true}).deviation, INFINITY);
}

// A robot whose first joint, and no other, is continuous, on its way from `start` to `goal` of
// that joint.
class ContinuousJointTest : public testing::Test {
 protected:
  // What becomes of a robot whose joints are at `at` of the time.
  absl::Status Follow(double start, double goal,
                      const std::function<RobotFeedback(double seconds)>& at) {
    const MotionLimits limits{.joint_speed = 0.5, .tolerance = 0.002, .continuous = {true, false}};
    MotionWatch watch({"turn", "lift"}, {start, 0}, {goal, 0}, limits, absl::ZeroDuration());
    for (absl::Duration now; now < absl::Seconds(30); now += kPeriod) {
      absl::Status status = watch.Tell(now, at(absl::ToDoubleSeconds(now)));
      if (status.ok()) status = watch.CheckTime(now);
      if (!status.ok() || watch.arrived()) return status;
    }
    return absl::UnknownError("it is still on its way");
  }
};

TEST_F(ContinuousJointTest, RobotThatReportsItsGoalATurnAwayHasArrived) {
  const auto back = [](double s) { return At(Wrapped(std::max(-3 - s / 2, -kPi - 1e-9)), 0); };
  EXPECT_EQ(Follow(-3, -kPi, back), absl::OkStatus());
}

TEST_F(ContinuousJointTest, RobotThatStaysAtItsGoalATurnAwayHasArrived) {
  EXPECT_EQ(Follow(kPi, -kPi, [](double) { return At(kPi, 0); }), absl::OkStatus());
}

TEST_F(ContinuousJointTest, RobotThatSetsOffLateForItsGoalATurnAwayHasNotArrivedBefore) {
  double at = kPi;
  const auto late = [&](double s) {
    at = std::max(kPi - std::max(s - 1, 0.0) / 2, -kPi);
    return At(at, 0);
  };
  EXPECT_EQ(Follow(kPi, -kPi, late), absl::OkStatus());
  EXPECT_NEAR(at, -kPi, 0.002);
}

TEST_F(ContinuousJointTest, RobotThatTakesTheShortWayWhereTheValuesSayTheLongOneIsStopped) {
  const auto shortest = [](double s) { return At(Wrapped(std::min(3 + s / 2, 2 * kPi - 3)), 0); };
  EXPECT_THAT(Follow(3, -3, shortest).message(), HasSubstr("leaves its way: 'turn'"));
  const auto as_the_values_say = [](double s) { return At(std::max(3 - s / 2, -3.0), 0); };
  EXPECT_EQ(Follow(3, -3, as_the_values_say), absl::OkStatus());
}

TEST_F(ContinuousJointTest, RobotHasTimeForTheWayFromWhatItReports) {
  const MotionLimits limits{.joint_speed = 0.5, .continuous = {true}};
  const MotionWatch watch({"turn"}, {kPi}, {-3}, limits, absl::ZeroDuration(),
                          std::vector<double>{-kPi});
  EXPECT_GT(watch.duration(), absl::Seconds(12));
}

TEST_F(ContinuousJointTest, RobotThatTurnsBackFromItsWayIsStopped) {
  const auto both = [](double s) { return At(s < 1 ? 3 - s / 2 : 2.5 + (s - 1) / 2, 0); };
  const absl::Status status = Follow(3, -3, both);
  EXPECT_TRUE(absl::IsAborted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("leaves its way: 'turn'"));
  const auto away = [](double s) { return At(-s / 2, 0); };
  EXPECT_THAT(Follow(0, 1, away).message(), HasSubstr("leaves its way: 'turn'"));
}

TEST_F(ContinuousJointTest, TurnsOfOtherJointsCount) {
  const auto lifted = [](double) { return At(0, 2 * kPi); };
  EXPECT_TRUE(absl::IsAborted(Follow(0, 0, lifted)));
}

// A robot that is where it is sent at once. It reports angles from -pi to pi.
class WrappingLink : public ControllerLink {
 public:
  struct Controller {
    std::mutex mutex;
    std::vector<double> positions = {0, 0};
    int stops = 0;
    absl::Status stopped;  // what stops answer
    bool loses = false;    // the connection, until the next report
    absl::Duration gone;   // for how long
    int reports = 0;
  };

  explicit WrappingLink(Controller& controller) : controller_(controller) {}
  ~WrappingLink() override {
    ending_ = true;
    if (thread_.joinable()) thread_.join();
  }

  const std::vector<std::string>& joints() const override { return joints_; }
  void Start(Observer observer) override {
    thread_ = std::thread([this, observer = std::move(observer)] {
      for (; !ending_; absl::SleepFor(absl::Milliseconds(5))) {
        RobotFeedback feedback;
        bool lost = false;
        absl::Duration gone;
        {
          const std::lock_guard lock(controller_.mutex);
          for (const double at : controller_.positions) {
            feedback.positions.push_back(Wrapped(at));
          }
          lost = std::exchange(controller_.loses, false);
          gone = controller_.gone;
        }
        if (lost) {
          observer.failed(absl::UnavailableError("it was switched off"));
          absl::SleepFor(gone);
        }
        observer.feedback(feedback);
        const std::lock_guard lock(controller_.mutex);
        ++controller_.reports;
      }
    });
  }
  absl::Status Move(std::span<const double> goal, absl::Duration /*duration*/) override {
    const std::lock_guard lock(controller_.mutex);
    controller_.positions.assign(goal.begin(), goal.end());
    return absl::OkStatus();
  }
  absl::Status Stop() override {
    const std::lock_guard lock(controller_.mutex);
    ++controller_.stops;
    return controller_.stopped;
  }

 private:
  Controller& controller_;
  const std::vector<std::string> joints_ = {"turn", "lift"};
  std::atomic<bool> ending_ = false;
  std::thread thread_;
};

class WrappingRobotTest : public testing::Test {
 protected:
  void Place(double turn, double lift) {
    const std::lock_guard lock(controller_.mutex);
    controller_.positions = {turn, lift};
  }
  int stops() {
    const std::lock_guard lock(controller_.mutex);
    return controller_.stops;
  }
  // The first joint is continuous; fast enough for a robot that jumps.
  std::unique_ptr<FeedbackRobot> Connect(absl::Duration silence = absl::Seconds(20)) {
    return std::make_unique<FeedbackRobot>(
        std::make_unique<WrappingLink>(controller_),
        MotionLimits{.joint_speed = 100, .silence = silence, .continuous = {true, false}});
  }
  // Loses the connection and returns when it is back; false: it is not.
  bool Lose(absl::Duration gone = absl::ZeroDuration()) {
    {
      const std::lock_guard lock(controller_.mutex);
      controller_.loses = true;
      controller_.gone = gone;
    }
    return Report();
  }
  // Returns when the controller has reported what it is now; false: it does not.
  bool Report() {
    const auto reports = [&] {
      const std::lock_guard lock(controller_.mutex);
      return controller_.reports;
    };
    const int before = reports();
    return Eventually([&] { return reports() >= before + 3; });
  }

  WrappingLink::Controller controller_;
};

TEST_F(WrappingRobotTest, RobotThatTremblesWhereItsAnglesWrapStandsStill) {
  const auto robot = Connect();
  for (const double turn : {-3.0, -kPi}) {
    ASSERT_EQ(robot->MoveTo(std::vector<double>{turn, 0}), absl::OkStatus());
  }
  for (int i = 0; i < 40; ++i) {
    Place(-kPi + (i % 2 == 0 ? 1e-4 : -1e-4), 0);
    absl::SleepFor(absl::Milliseconds(5));
    const absl::StatusOr<RobotState> state = robot->State();
    ASSERT_TRUE(state.ok()) << state.status();
    EXPECT_FALSE(state->moving);
  }
  EXPECT_EQ(robot->MoveTo(std::vector<double>{-3, 0}), absl::OkStatus());
  EXPECT_EQ(stops(), 0);
  Place(-2.9, 0);
  EXPECT_TRUE(Eventually([&] { return stops() > 0; })) << "it leaves its place";
}

TEST_F(WrappingRobotTest, PositionThatIsNotANumberIsUnavailableAndNamesItsJoint) {
  const auto robot = Connect();
  for (const double wrong : {std::nan(""), static_cast<double>(INFINITY)}) {
    Place(0, wrong);
    ASSERT_TRUE(Eventually([&] { return !robot->State().ok(); }));
    for (const absl::Status& status :
         {robot->State().status(), robot->MoveTo(std::vector<double>{0, 0})}) {
      EXPECT_TRUE(absl::IsUnavailable(status)) << status;
      EXPECT_THAT(status.message(), HasSubstr("position of 'lift' that is not a number"));
    }
    Place(0, 0);
    EXPECT_TRUE(Eventually([&] { return robot->State().ok(); })) << "it is not given up";
  }
  ASSERT_EQ(robot->MoveTo(std::vector<double>{1, 0}), absl::OkStatus());
  Place(1, std::nan(""));
  ASSERT_TRUE(Eventually([&] { return stops() > 0; })) << "it may move unseen";
  EXPECT_THAT(robot->State().status().message(), HasSubstr("'lift' that is not a number"));
}

TEST_F(WrappingRobotTest, PositionThatIsNoNumberForAMomentStopsTheRobotAndIsALossThatEnds) {
  const auto robot = Connect();
  ASSERT_EQ(robot->MoveTo(std::vector<double>{1, 0}), absl::OkStatus());
  Place(1, std::nan(""));
  ASSERT_TRUE(Report());
  Place(1, 0);
  ASSERT_TRUE(Report());
  EXPECT_TRUE(Eventually([&] { return stops() == 1; })) << stops();
  const absl::Status lost = robot->MoveTo(std::vector<double>{0, 0});
  EXPECT_TRUE(absl::IsUnavailable(lost)) << lost;
  EXPECT_THAT(lost.message(), HasSubstr("position of 'lift' that is not a number"));
  const absl::StatusOr<RobotState> state = robot->State();
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->positions[0], 1);
  EXPECT_FALSE(state->moving);
  EXPECT_EQ(robot->MoveTo(std::vector<double>{0, 0}), absl::OkStatus());
  EXPECT_EQ(stops(), 1);
}

TEST_F(WrappingRobotTest, StopThatDoesNotReachARobotWithoutANumberIsALossOfItsOwn) {
  const auto robot = Connect();
  ASSERT_EQ(robot->MoveTo(std::vector<double>{1, 0}), absl::OkStatus());
  {
    const std::lock_guard lock(controller_.mutex);
    controller_.stopped = absl::InternalError("no answer");
    controller_.positions = {1, std::nan("")};
  }
  ASSERT_TRUE(Eventually([&] { return stops() == 1; }));
  Place(1, 0);
  ASSERT_TRUE(Report());
  ASSERT_TRUE(Report());
  const absl::Status lost = robot->MoveTo(std::vector<double>{0, 0});
  EXPECT_TRUE(absl::IsUnavailable(lost)) << lost;
  EXPECT_THAT(lost.message(), HasSubstr("the stop command to the robot failed: no answer"));
}

TEST_F(WrappingRobotTest, RobotThatLeftItsPlaceWhileItReportedNoNumberIsGivenUp) {
  const auto robot = Connect();
  ASSERT_EQ(robot->MoveTo(std::vector<double>{1, 0}), absl::OkStatus());
  Place(1, std::nan(""));
  ASSERT_TRUE(Report());
  Place(1.1, 0);
  ASSERT_TRUE(Report());
  const absl::Status status = robot->State().status();
  EXPECT_TRUE(absl::IsAborted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("'turn' has left its place"));
}

TEST_F(WrappingRobotTest, AnotherNumberOfPositionsThanJointsIsRefusedWithBothNumbers) {
  const auto report = [&](size_t count) {
    const std::lock_guard lock(controller_.mutex);
    controller_.positions.assign(count, 0);
  };
  const std::vector<std::pair<size_t, std::string>> wrong = {
      {0, "0 positions"}, {1, "1 position"}, {3, "3 positions"}};
  const auto robot = Connect();
  for (const auto& [count, spoken] : wrong) {
    report(count);
    ASSERT_TRUE(Eventually([&] { return !robot->State().ok(); })) << spoken;
    for (const absl::Status& status :
         {robot->State().status(), robot->MoveTo(std::vector<double>{0, 0})}) {
      EXPECT_TRUE(absl::IsInternal(status)) << status;
      EXPECT_EQ(status.message(), "the robot reported " + spoken +
                                      " and has 2 joints (turn, lift); correct its driver");
    }
    report(2);
    EXPECT_TRUE(Eventually([&] { return robot->State().ok(); })) << "it is not given up";
  }
  ASSERT_EQ(robot->MoveTo(std::vector<double>{0, 0}), absl::OkStatus());
  report(1);
  ASSERT_TRUE(Eventually([&] { return stops() > 0; })) << "it may move unseen";
  EXPECT_THAT(robot->State().status().message(), HasSubstr("1 position and has 2 joints"));
}

TEST_F(WrappingRobotTest, ConnectionThatWasLostForAMomentIsReportedOnceAndKeepsTheRobotWhereItIs) {
  const auto robot = Connect();
  ASSERT_EQ(robot->MoveTo(std::vector<double>{1, 0}), absl::OkStatus());
  ASSERT_TRUE(Lose());
  const absl::Status state = robot->State().status();
  EXPECT_TRUE(absl::IsUnavailable(state)) << state;
  EXPECT_THAT(state.message(), HasSubstr("lost for a moment: it was switched off"));
  EXPECT_EQ(robot->State().status(), absl::OkStatus());
  ASSERT_TRUE(Lose());
  EXPECT_TRUE(absl::IsUnavailable(robot->MoveTo(std::vector<double>{0, 0})));
  EXPECT_EQ(robot->State()->positions[0], 1);
  EXPECT_EQ(robot->MoveTo(std::vector<double>{0, 0}), absl::OkStatus());
}

TEST_F(WrappingRobotTest, ReasonOfALossIsTheFirst) {
  const auto robot = Connect(absl::Seconds(1));
  ASSERT_TRUE(Eventually([&] { return robot->State().ok(); }));
  ASSERT_TRUE(Lose(absl::Milliseconds(1500)));
  EXPECT_THAT(robot->State().status().message(), HasSubstr("it was switched off"));
}

TEST(MotionLimits, LimitsThatAreNoneAreRefused) {
  EXPECT_THROW(CheckLimits({.joint_speed = 0}), std::invalid_argument);
  EXPECT_THROW(CheckLimits({.tolerance = std::nan("")}), std::invalid_argument);
  EXPECT_THROW(CheckLimits({.silence = absl::ZeroDuration()}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
