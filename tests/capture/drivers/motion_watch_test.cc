// SPDX-License-Identifier: Apache-2.0
// What is believed of a robot on its way, with a clock of the test's own.
#include "capture/drivers/robots/motion_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

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
  EXPECT_TRUE(absl::IsAborted(watch_.Tell(now_, {.positions = {0}})));
  EXPECT_TRUE(absl::IsAborted(watch_.Tell(now_, At(0, std::nan("")))));
}

TEST(MotionLimits, LimitsThatAreNoneAreRefused) {
  EXPECT_THROW(CheckLimits({.joint_speed = 0}), std::invalid_argument);
  EXPECT_THROW(CheckLimits({.tolerance = std::nan("")}), std::invalid_argument);
  EXPECT_THROW(CheckLimits({.silence = absl::ZeroDuration()}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
