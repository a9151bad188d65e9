// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/robots/feedback_robot.h"

#include <chrono>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "capture/devices/joint_deviation.h"
#include "capture/devices/running_clock.h"
#include "common/result/result.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr std::chrono::milliseconds kTick{10};

std::string SpokenSilence(absl::Duration silence) {
  return SpokenTime(absl::Trunc(silence, absl::Milliseconds(10)));
}

}  // namespace

FeedbackRobot::FeedbackRobot(std::unique_ptr<ControllerLink> link, const MotionLimits& limits)
    : limits_(limits), names_(link->joints()), stillness_(limits), link_(std::move(link)) {
  CheckLimits(limits_);
  guard_ = std::thread([this] { StopWhenAlarmed(); });
  link_->Start({.feedback = [this](const RobotFeedback& feedback) { OnFeedback(feedback); },
                .failed = [this](const absl::Status& why) { OnFailure(why); }});
}

FeedbackRobot::~FeedbackRobot() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  guard_.join();
  link_.reset();
}

absl::Status FeedbackRobot::CheckNumbers(std::span<const double> positions) const {
  for (size_t j = 0; j < names_.size(); ++j) {
    if (std::isfinite(positions[j])) continue;
    return absl::UnavailableError(absl::StrCat("the robot reported a position of '", names_[j],
                                               "' that is not a number: ", positions[j],
                                               "; check its controller or driver"));
  }
  return absl::OkStatus();
}

absl::Status FeedbackRobot::CheckCount(const RobotFeedback& feedback) const {
  if (feedback.positions.size() == names_.size()) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(
      "the robot reported ", Counted(feedback.positions.size(), "position"), " and has ",
      Counted(names_.size(), "joint"), " (", absl::StrJoin(names_, ", "), "); correct its driver",
      feedback.fault.empty() ? "" : absl::StrCat("; it reports, too: ", feedback.fault)));
}

absl::Status FeedbackRobot::CheckHold(const RobotFeedback& feedback) const {
  RETURN_IF_ERROR(newest_count_);
  if (!feedback.fault.empty()) {
    return absl::AbortedError(absl::StrCat("the robot reports: ", feedback.fault));
  }
  RETURN_IF_ERROR(newest_numbers_);
  const JointDeviation off = GreatestDeviation(*hold_, feedback.positions, limits_.continuous);
  if (off.deviation <= limits_.tolerance) return absl::OkStatus();
  return absl::AbortedError(
      absl::StrFormat("the robot moves when it should stand still: '%s' has left its place by %.4f",
                      names_[off.joint], off.deviation));
}

void FeedbackRobot::GuardHold(const RobotFeedback& feedback, bool was_seen) {
  const absl::Status held = CheckHold(feedback);
  if (held.ok()) return;
  if (!absl::IsUnavailable(held)) {
    alarm_ = held;
    hold_.reset();
  } else if (was_seen) {
    untold_loss_.Update(held);
  } else {
    return;
  }
  alarmed_ = true;
}

void FeedbackRobot::OnFeedback(const RobotFeedback& feedback) {
  const std::lock_guard lock(mutex_);
  const absl::Duration now = RunningNow();
  if (newest_ && !loss_told_ && untold_loss_.ok() && now - newest_time_ > limits_.silence) {
    untold_loss_ = absl::UnavailableError(
        absl::StrCat("the connection to the robot was lost: it did not report its position for ",
                     SpokenSilence(now - newest_time_)));
  }
  loss_told_ = false;
  newest_ = feedback;
  newest_count_ = CheckCount(feedback);
  const bool counted = newest_count_.ok();
  const absl::Status before =
      std::exchange(newest_numbers_, counted ? CheckNumbers(feedback.positions) : absl::OkStatus());
  newest_time_ = now;
  link_failure_ = absl::OkStatus();
  if (counted && newest_numbers_.ok()) stillness_.Add(newest_time_, feedback.positions);
  if (move_) {
    if (move_failure_.ok()) {
      move_failure_ = counted ? move_->Tell(newest_time_, feedback) : newest_count_;
    }
  } else if (hold_) {
    GuardHold(feedback, /*was_seen=*/before.ok());
  }
  changed_.notify_all();
}

void FeedbackRobot::OnFailure(const absl::Status& why) {
  const std::lock_guard lock(mutex_);
  link_failure_ = why;
  const bool lost = absl::IsUnavailable(why);
  if (move_) {
    if (move_failure_.ok()) move_failure_ = why;
    loss_told_ = loss_told_ || lost;  // MoveTo() does
  } else if (lost && newest_ && !loss_told_ && untold_loss_.ok()) {
    untold_loss_ = absl::UnavailableError(
        absl::StrCat("the connection to the robot was lost for a moment: ", why.message()));
  }
  changed_.notify_all();
}

void FeedbackRobot::StopWhenAlarmed() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return alarmed_ || ending_; });
    if (!alarmed_) return;
    alarmed_ = false;
    stopping_ = true;
    lock.unlock();
    const absl::Status stopped = link_->Stop();
    lock.lock();
    stopping_ = false;
    changed_.notify_all();
    if (stopped.ok()) continue;
    if (alarm_.ok()) {
      untold_loss_ = absl::UnavailableError(
          absl::StrCat("the stop command to the robot failed: ", stopped.message()));
    } else {
      alarm_ = absl::AbortedError(
          absl::StrCat(alarm_.message(), "; the stop command failed: ", stopped.message()));
    }
  }
}

absl::Status FeedbackRobot::Silence(absl::Duration now) {
  const bool silent = now - newest_time_ > limits_.silence;
  loss_told_ = loss_told_ || silent || !link_failure_.ok();
  const absl::Status past = std::exchange(untold_loss_, absl::OkStatus());
  if (!link_failure_.ok()) return link_failure_;
  if (silent) {
    return absl::UnavailableError(absl::StrCat("the robot has not reported its position for ",
                                               SpokenSilence(now - newest_time_),
                                               "; the connection to it is lost"));
  }
  return past;
}

absl::StatusOr<RobotFeedback> FeedbackRobot::Newest(std::unique_lock<std::mutex>& lock) {
  changed_.wait_for(lock, absl::ToChronoMilliseconds(limits_.silence),
                    [&] { return newest_.has_value() || !link_failure_.ok(); });
  if (!alarm_.ok()) return alarm_;
  if (link_failure_.ok() && !newest_) {
    return absl::UnavailableError(
        absl::StrCat("the robot did not report its position within ", SpokenTime(limits_.silence)));
  }
  RETURN_IF_ERROR(Silence(RunningNow()));
  RETURN_IF_ERROR(newest_count_);
  RETURN_IF_ERROR(newest_numbers_);
  return *newest_;
}

absl::Status FeedbackRobot::WaitForArrival(std::unique_lock<std::mutex>& lock) {
  while (true) {
    const absl::Duration now = RunningNow();
    if (!move_failure_.ok()) return move_failure_;
    if (stop_asked_) return absl::AbortedError("the robot was stopped on the way");
    RETURN_IF_ERROR(Silence(now));
    if (move_->arrived()) return absl::OkStatus();
    RETURN_IF_ERROR(move_->CheckTime(now));
    changed_.wait_for(lock, kTick);
  }
}

absl::Status FeedbackRobot::MoveTo(std::span<const double> positions) {
  const std::vector<double> goal(positions.begin(), positions.end());
  if (goal.size() != names_.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the robot has ", names_.size(), " joints, not ", goal.size()));
  }
  for (size_t j = 0; j < goal.size(); ++j) {
    if (!std::isfinite(goal[j])) {
      return absl::InvalidArgumentError(absl::StrCat("no number for '", names_[j], "'"));
    }
  }
  std::unique_lock lock(mutex_);
  stop_asked_ = false;
  changed_.wait(lock, [&] { return !alarmed_ && !stopping_; });  // that stop is of no later move
  if (stop_asked_) return absl::AbortedError("the robot was stopped before it set off");
  ASSIGN_OR_RETURN(const RobotFeedback start, Newest(lock));
  for (const std::string& hindrance : {start.fault, start.not_ready}) {
    if (!hindrance.empty()) {
      return absl::AbortedError(absl::StrCat("the robot cannot move: ", hindrance));
    }
  }
  move_failure_ = absl::OkStatus();
  move_.emplace(names_, start.positions, goal, limits_, RunningNow(), hold_);
  hold_.reset();
  const absl::Duration duration = move_->duration();
  lock.unlock();
  absl::Status status = link_->Move(goal, duration);
  lock.lock();
  if (status.ok()) status = WaitForArrival(lock);
  move_.reset();
  if (status.ok()) {
    hold_ = NearestTurns(newest_->positions, goal, limits_.continuous);
    return status;
  }
  lock.unlock();
  if (const absl::Status stopped = link_->Stop(); !stopped.ok()) {
    return absl::Status(
        status.code(),
        absl::StrCat(status.message(), "; the stop command failed: ", stopped.message()));
  }
  return status;
}

absl::StatusOr<RobotState> FeedbackRobot::State() {
  std::unique_lock lock(mutex_);
  ASSIGN_OR_RETURN(RobotFeedback newest, Newest(lock));
  return RobotState{.positions = std::move(newest.positions),
                    .moving = newest.moving.value_or(false) || stillness_.moving(),
                    .not_before = newest.not_before.value_or(newest_time_)};
}

absl::Status FeedbackRobot::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stop_asked_ = true;
    hold_.reset();
  }
  changed_.notify_all();
  return link_->Stop();
}

}  // namespace silhouette
