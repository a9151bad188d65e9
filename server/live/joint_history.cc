// SPDX-License-Identifier: Apache-2.0
#include "server/live/joint_history.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/session/cell_robot.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "server/live/helpers.h"
#include "server/scene/robot_in_scene.h"

namespace silhouette {

JointHistory::JointHistory(Settings settings, std::vector<bool> continuous)
    : settings_(settings), continuous_(std::move(continuous)) {}

absl::Status JointHistory::Add(absl::Duration asked, absl::Duration answered,
                               std::span<const double> positions) {
  absl::Status status;
  if (positions.size() != continuous_.size()) {
    status =
        absl::InternalError(absl::StrCat("the robot reported the positions of ", positions.size(),
                                         " joints and has ", continuous_.size()));
  } else if (!std::ranges::all_of(positions, [](double value) { return std::isfinite(value); })) {
    status = absl::InternalError("the robot reported a position that is not a finite number");
  }
  {
    const std::lock_guard lock(mutex_);
    fault_ = status;
    if (status.ok()) {
      // Images are joined to joints long before that.
      const absl::Duration oldest = answered - 2 * settings_.gap - absl::Seconds(10);
      const auto kept = std::ranges::find_if(
          samples_, [&](const Sample& sample) { return sample.answered >= oldest; });
      if (kept - samples_.begin() > std::ssize(samples_) / 2)
        samples_.erase(samples_.begin(), kept);
      samples_.push_back({asked, answered, {positions.begin(), positions.end()}});
    }
  }
  changed_.notify_all();
  return status;
}

void JointHistory::Fail(const absl::Status& why) {
  {
    const std::lock_guard lock(mutex_);
    fault_ = why;
  }
  changed_.notify_all();
}

absl::StatusOr<std::span<const JointHistory::Sample>> JointHistory::Around(
    absl::Duration first, absl::Duration last) const {
  const auto after = std::ranges::lower_bound(samples_, last, {}, &Sample::asked);
  const auto later = std::ranges::upper_bound(samples_, first, {}, &Sample::answered);
  const std::string near = absl::StrCat("within ", SpokenTime(settings_.gap));
  if (later == samples_.begin() || first - std::prev(later)->asked > settings_.gap) {
    return absl::UnavailableError(
        absl::StrCat("the robot did not report its joints ", near, " before the images"));
  }
  if (after == samples_.end() || after->answered - last > settings_.gap) {
    return absl::DeadlineExceededError(
        absl::StrCat("the robot did not report its joints ", near, " after the images"));
  }
  return std::span(std::prev(later), std::next(after));
}

absl::StatusOr<std::vector<JointHistory::Range>> JointHistory::RangesOf(
    std::span<const Sample> samples) const {
  std::vector<Range> ranges;
  for (size_t joint = 0; joint < continuous_.size(); ++joint) {
    const double start = samples.front().positions[joint];
    double lower = start;
    double upper = start;
    for (const Sample& sample : samples) {
      double moved = sample.positions[joint] - start;
      if (continuous_[joint]) moved = std::remainder(moved, 2 * std::numbers::pi);
      lower = std::min(lower, start + moved);
      upper = std::max(upper, start + moved);
    }
    if (!(upper - lower <= settings_.max_movement)) {
      return absl::AbortedError(absl::StrCat(
          "the robot moved a joint by ", upper - lower,
          " while the images were taken, more than max_joint_movement, ", settings_.max_movement));
    }
    ranges.push_back({(lower + upper) / 2, (upper - lower) / 2});
  }
  return ranges;
}

absl::StatusOr<std::vector<JointHistory::Range>> JointHistory::Between(
    absl::Duration first, absl::Duration last, absl::Duration longest) const {
  std::unique_lock lock(mutex_);
  const auto told = [&] {
    return !fault_.ok() || (!samples_.empty() && samples_.back().asked >= last);
  };
  changed_.wait_for(lock, absl::ToChronoNanoseconds(longest), told);
  const auto samples = Around(first, last);
  if (samples.ok()) return RangesOf(*samples);
  return fault_.ok() ? samples.status() : fault_;
}

namespace {

std::vector<bool> Continuous(const storage::v1::CellDescription& cell) {
  std::vector<bool> continuous;
  for (const auto& joint : cell.grid_joints()) continuous.push_back(joint.continuous());
  continuous.resize(continuous.size() + static_cast<size_t>(cell.fixed_joints_size()), false);
  return continuous;
}

}  // namespace

JointPoller::JointPoller(const storage::v1::CellDescription& cell, const LiveSettings& settings,
                         Clock clock, OpenRobotFunction open, std::unique_ptr<Robot> robot,
                         LiveRecord& record)
    : cell_(cell),
      settings_(settings),
      clock_(std::move(clock)),
      open_(std::move(open)),
      record_(record),
      joints_(JointNames(cell)),
      robot_(std::move(robot)),
      history_({.gap = settings.joints_gap, .max_movement = settings.max_joint_movement},
               Continuous(cell)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

absl::StatusOr<std::vector<JointPosition>> JointPoller::Between(absl::Duration first,
                                                                absl::Duration last) const {
  ASSIGN_OR_RETURN(const std::vector<JointHistory::Range> ranges,
                   history_.Between(first, last, settings_.joints_gap));
  std::vector<JointPosition> joints;
  for (size_t i = 0; i < joints_.size(); ++i) {
    joints.push_back({joints_[i], ranges[i].middle, ranges[i].half});
  }
  return joints;
}

absl::Status JointPoller::Ask() {
  if (robot_ == nullptr) {
    ASSIGN_OR_RETURN(std::unique_ptr<Robot> opened, open_());
    // The same joints as at capture, whatever their order.
    RETURN_IF_ERROR(CellRobot::Create(cell_, *opened).status());
    robot_ = std::move(opened);
  }
  const absl::Duration asked = clock_().running;
  const absl::StatusOr<RobotState> state = robot_->State();
  const Moment answered = clock_();
  if (!state.ok()) return state.status();
  if (state->not_before && state->not_before == not_before_) return absl::OkStatus();  // not new
  not_before_ = state->not_before;
  const std::vector<std::string>& known = robot_->joints();
  std::vector<double> positions;
  for (const std::string& joint : joints_) {
    positions.push_back(
        state->positions[static_cast<size_t>(std::ranges::find(known, joint) - known.begin())]);
  }
  const absl::Duration measured = std::min(asked, state->not_before.value_or(asked));
  const absl::Status added = history_.Add(measured, answered.running, positions);
  if (added.ok()) record_.NoteJoints(answered);
  return added;
}

void JointPoller::Run(const std::stop_token& stop) {
  const auto failed = [this](const absl::Status& error) {
    history_.Fail(error);
    record_.NoteJointsError(error);
  };
  AskAgainAndAgain(
      stop, clock_, settings_, settings_.joints_interval, [this] { return Ask(); }, failed,
      [this] { robot_.reset(); });
}

}  // namespace silhouette
