// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/robots/motion_watch.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/devices/joint_deviation.h"
#include "common/times/times.h"

namespace silhouette {
namespace {

// A robot that has gone further than this many times what joint_speed allows is stopped. Ways begin
// and end slowly: in between they are ahead of an even motion by a fifth.
constexpr double kTooFast = 1.5;
// Messages and commands take their time.
constexpr absl::Duration kLatency = absl::Milliseconds(250);
// How far a joint may leave the range between start and goal, in tolerances.
constexpr double kAstray = 10;
// No way is so short that it takes less.
constexpr absl::Duration kLeastDuration = absl::Milliseconds(20);

}  // namespace

void CheckLimits(const MotionLimits& limits) {
  const auto check = [](bool good, const char* name) {
    if (!good) throw std::invalid_argument(absl::StrCat("'", name, "' must be greater than 0"));
  };
  check(limits.joint_speed > 0, "joint_speed");
  check(limits.tolerance > 0, "joint_tolerance");
  check(limits.patience > absl::ZeroDuration(), "arrival_timeout");
  check(limits.silence > absl::ZeroDuration(), "feedback_timeout");
}

void Stillness::Add(absl::Duration when, const std::vector<double>& positions) {
  samples_.push_back({when, positions});
  // One sample that is a moment old or older stays, and the least number that can show stillness.
  while (samples_.size() > kLeast && when - samples_[1].when >= kMoment) samples_.pop_front();
}

double Stillness::Change() const {
  double change = 0;
  for (const Sample& sample : samples_) {
    change = std::max(
        change,
        GreatestDeviation(sample.positions, samples_.back().positions, continuous_).deviation);
  }
  return change;
}

bool Stillness::still() const {
  return samples_.size() >= kLeast && samples_.back().when - samples_.front().when >= kMoment &&
         Change() <= change_;
}

bool Stillness::moving() const { return Change() > change_; }

MotionWatch::MotionWatch(std::vector<std::string> names, std::vector<double> start,
                         std::vector<double> goal, const MotionLimits& limits, absl::Duration begin,
                         const std::optional<std::vector<double>>& held)
    : names_(std::move(names)),
      start_(held ? NearestTurns(start, *held, limits.continuous) : start),
      goal_(std::move(goal)),
      limits_(limits),
      begin_(begin),
      stillness_(limits),
      progress_(start_),
      newest_(start_),
      last_progress_(begin) {
  CheckLimits(limits_);
  if (start_.size() != names_.size() || goal_.size() != names_.size()) {
    throw std::invalid_argument("start and goal must have a value for every joint");
  }
  // A controller may interpolate from what it reports.
  const double farthest = std::max(GreatestDeviation(start, goal_).deviation,
                                   GreatestDeviation(start_, goal_).deviation);
  if (!std::isfinite(farthest)) throw std::invalid_argument("start and goal must be numbers");
  duration_ = std::max(absl::Seconds(farthest / limits_.joint_speed), kLeastDuration);
}

absl::Status MotionWatch::Tell(absl::Duration now, const RobotFeedback& feedback) {
  if (!feedback.fault.empty()) {
    return absl::AbortedError(absl::StrCat("the robot reports: ", feedback.fault));
  }
  const std::vector<double> positions =
      NearestTurns(feedback.positions, newest_, limits_.continuous);
  const JointDeviation gone = GreatestDeviation(start_, positions);
  const double seconds = absl::ToDoubleSeconds(now - begin_ + kLatency);
  if (!std::isfinite(gone.deviation)) {
    return absl::UnavailableError(absl::StrCat("the robot reported a position of '",
                                               names_[gone.joint], "' that is not a number"));
  }
  if (gone.deviation > kTooFast * limits_.joint_speed * seconds + limits_.tolerance) {
    return absl::AbortedError(absl::StrFormat(
        "the robot is too fast: '%s' went %.3f within %.2f s, and %.3f per second is allowed",
        names_[gone.joint], gone.deviation, absl::ToDoubleSeconds(now - begin_),
        limits_.joint_speed));
  }
  for (size_t j = 0; j < names_.size(); ++j) {
    const auto [lower, upper] = std::minmax(start_[j], goal_[j]);
    const double at = positions[j];
    const double astray = std::max(lower - at, at - upper);
    if (astray <= kAstray * limits_.tolerance) continue;
    return absl::AbortedError(absl::StrFormat(
        "the robot leaves its way: '%s' is at %.4f, and its way is from %.4f to %.4f", names_[j],
        at, start_[j], goal_[j]));
  }
  if (GreatestDeviation(progress_, positions).deviation > limits_.tolerance / 2) {
    last_progress_ = now;
    progress_ = positions;
  }
  newest_ = positions;
  stillness_.Add(now, positions);
  // Who does not set off may have been there, a full turn away.
  const bool stays = now - last_progress_ > limits_.patience / 2;
  const double off =
      GreatestDeviation(goal_, positions, stays ? limits_.continuous : std::vector<bool>())
          .deviation;
  arrived_ = !feedback.moving.value_or(false) && stillness_.still() && off <= limits_.tolerance;
  return absl::OkStatus();
}

std::string MotionWatch::WhereItIs() const {
  const JointDeviation off = GreatestDeviation(goal_, newest_, limits_.continuous);
  if (off.deviation <= limits_.tolerance) return "it is there, but does not come to rest";
  return absl::StrFormat("'%s' is %.4f from where it should be", names_[off.joint], off.deviation);
}

absl::Status MotionWatch::CheckTime(absl::Duration now) const {
  if (now - last_progress_ > limits_.patience) {
    return absl::DeadlineExceededError(absl::StrFormat(
        "the robot did not arrive: it has not moved on for %s, and %s",
        SpokenTime(absl::Trunc(now - last_progress_, absl::Milliseconds(100))), WhereItIs()));
  }
  const absl::Duration longest = 2 * duration_ + limits_.patience;
  if (now - begin_ > longest) {
    return absl::DeadlineExceededError(
        absl::StrFormat("the robot did not arrive within %s: %s",
                        SpokenTime(absl::Trunc(longest, absl::Milliseconds(100))), WhereItIs()));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
