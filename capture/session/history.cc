// SPDX-License-Identifier: Apache-2.0
#include "capture/session/history.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "db/status/status_macros.h"

namespace silhouette {

void SetTime(absl::Time time, google::protobuf::Timestamp& stamp) {
  if (time == absl::InfinitePast()) time = absl::UnixEpoch();
  const int64_t nanoseconds = absl::ToUnixNanos(time);
  stamp.set_seconds(nanoseconds / 1'000'000'000);
  stamp.set_nanos(static_cast<int32_t>(nanoseconds % 1'000'000'000));
}

absl::Status ChangeHistory(Database& database,
                           const std::function<void(storage::v1::CaptureHistory&)>& change) {
  storage::v1::CaptureHistory history;
  {
    ASSIGN_OR_RETURN(const auto snapshot, database.Read());
    ASSIGN_OR_RETURN(auto read, snapshot.CaptureHistory());
    history = std::move(read);
  }
  change(history);
  return database.SetCaptureHistory(history);
}

absl::Time LastGoodCheck(const storage::v1::CaptureHistory& history) {
  absl::Time last = absl::InfinitePast();
  for (const storage::v1::SentinelCheck& check : history.checks()) {
    if (check.alarm().empty()) last = TimeOf(check.time());
  }
  return last;
}

absl::StatusOr<absl::Time> LatestCapture(const Snapshot& snapshot) {
  absl::Time latest = absl::InfinitePast();
  const absl::Status status =
      snapshot.ForEach([&](ConfigurationNumber, const absl::StatusOr<RobotImage>& image) {
        if (image.ok() && !image->excluded) latest = std::max(latest, image->captured);
        return true;
      });
  // Others report damaged records.
  if (!status.ok() && !absl::IsDataLoss(status)) return status;
  return latest;
}

absl::StatusOr<std::vector<ConfigurationNumber>> SuspectNumbers(const Snapshot& snapshot) {
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  std::vector<ConfigurationNumber> numbers;
  const SuspectSpans suspect(history);
  if (suspect.empty()) return numbers;
  const absl::Status status =
      snapshot.ForEach([&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
        if (image.ok() && !image->excluded && suspect.Contain(image->captured)) {
          numbers.push_back(number);
        }
        return true;
      });
  // Others report damaged records.
  if (!status.ok() && !absl::IsDataLoss(status)) return status;
  return numbers;
}

CaptureRepeatability RepeatabilityOf(const storage::v1::CaptureHistory& history,
                                     const storage::v1::CellDescription& cell) {
  CaptureRepeatability result;
  std::vector<int> with_shift(static_cast<size_t>(cell.views_size()), 0);
  for (const storage::v1::View& view : cell.views()) result.views.push_back({.name = view.name()});
  int sights = 0;
  for (const storage::v1::SentinelCheck& check : history.checks()) {
    ++(check.alarm().empty() ? result.checks : result.alarms);
    if (!check.alarm().empty()) continue;
    for (const storage::v1::SentinelSight& sight : check.sights()) {
      if (sight.view() < 0 || sight.view() >= cell.views_size()) continue;
      ViewRepeatability& view = result.views[static_cast<size_t>(sight.view())];
      const double shift = std::hypot(sight.shift_x(), sight.shift_y());
      if (std::isfinite(shift)) {
        ++with_shift[static_cast<size_t>(sight.view())];
        view.shift += shift * shift;
        view.greatest_shift = std::max(view.greatest_shift, shift);
      }
      view.mask_pixels += sight.mask_pixels();
      view.most_mask_pixels = std::max(view.most_mask_pixels, sight.mask_pixels());
      view.least_gain = view.sights == 0 ? sight.gain() : std::min(view.least_gain, sight.gain());
      view.greatest_gain =
          view.sights == 0 ? sight.gain() : std::max(view.greatest_gain, sight.gain());
      ++view.sights;
      ++sights;
      result.joint += sight.joint_deviation() * sight.joint_deviation();
      result.greatest_joint = std::max(result.greatest_joint, sight.joint_deviation());
    }
  }
  for (size_t v = 0; v < result.views.size(); ++v) {
    ViewRepeatability& view = result.views[v];
    if (view.sights > 0) view.mask_pixels /= view.sights;
    view.shift = with_shift[v] > 0 ? std::sqrt(view.shift / with_shift[v]) : NAN;
    if (with_shift[v] == 0) view.greatest_shift = NAN;
  }
  if (sights > 0) result.joint = std::sqrt(result.joint / sights);
  return result;
}

}  // namespace silhouette
