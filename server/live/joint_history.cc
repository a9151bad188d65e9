#include "server/live/joint_history.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"

namespace silhouette {

JointHistory::JointHistory(Settings settings, std::vector<bool> continuous)
    : settings_(settings), continuous_(std::move(continuous)) {}

absl::Status JointHistory::Add(absl::Duration asked, absl::Duration answered,
                               std::span<const double> positions) {
  absl::Status status;
  if (positions.size() != continuous_.size()) {
    status = absl::InternalError(absl::StrCat("the robot told the positions of ", positions.size(),
                                              " joints and has ", continuous_.size()));
  } else if (!std::ranges::all_of(positions, [](double value) { return std::isfinite(value); })) {
    status = absl::InternalError("the robot told a position that is not a finite number");
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
  const std::string near = absl::StrCat("within ", absl::FormatDuration(settings_.gap));
  if (later == samples_.begin() || first - std::prev(later)->asked > settings_.gap) {
    return absl::UnavailableError(
        absl::StrCat("the robot did not tell its joints ", near, " before the images"));
  }
  if (after == samples_.end() || after->answered - last > settings_.gap) {
    return absl::DeadlineExceededError(
        absl::StrCat("the robot did not tell its joints ", near, " after the images"));
  }
  return std::span(std::prev(later), std::next(after));
}

absl::StatusOr<std::vector<double>> JointHistory::MiddleOf(std::span<const Sample> samples) const {
  std::vector<double> middle;
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
    middle.push_back((lower + upper) / 2);
  }
  return middle;
}

absl::StatusOr<std::vector<double>> JointHistory::Between(absl::Duration first, absl::Duration last,
                                                          absl::Duration longest) const {
  std::unique_lock lock(mutex_);
  const auto told = [&] {
    return !fault_.ok() || (!samples_.empty() && samples_.back().asked >= last);
  };
  changed_.wait_for(lock, absl::ToChronoNanoseconds(longest), told);
  const auto samples = Around(first, last);
  if (samples.ok()) return MiddleOf(*samples);
  return fault_.ok() ? samples.status() : fault_;
}

}  // namespace silhouette
