// SPDX-License-Identifier: Apache-2.0
// Arrivals: whether the images of a stream come late, by when they come alone.
#pragma once

#include <algorithm>
#include <optional>

#include "absl/time/time.h"

namespace silhouette {

// A stream that was held up, as on a network, delivers afterwards what has piled up, faster than
// it was taken: those images are older than the stream's latency. A plain value.
class Arrivals {
 public:
  // `latency`: of the stream as it is meant to be.
  explicit Arrivals(absl::Duration latency) : latency_(latency) {}

  // An image arrived at `now`, which never steps back.
  void Note(absl::Duration now) {
    if (last_) NoteGap(now - *last_);
    last_ = now;
    if (late()) late_until_ = now + latency_;
  }

  // Images that arrive before then may have been held up.
  absl::Duration late_until() const { return late_until_; }

 private:
  void NoteGap(absl::Duration gap) {
    count_ = std::min(count_ + 1, kMean + 1);
    lag_ = std::max(lag_ + gap - usual_, absl::ZeroDuration());
    // What has piled up comes faster.
    steady_ = gap > 0.75 * usual_ && gap < 2 * usual_ ? steady_ + 1 : 0;
    if (steady_ >= kSteady) lag_ = absl::ZeroDuration();
    // The mean at first; then a pause counts as two gaps, and what has piled up not at all.
    const bool known = count_ > kMean;
    const absl::Duration change = (known ? std::min(gap, 2 * usual_) : gap) - usual_;
    if (!(known && late()) || change > absl::ZeroDuration())
      usual_ += change / std::min(count_, kMean);
  }

  bool late() const { return lag_ > std::max(latency_ / 4, 2 * usual_); }

  static constexpr int kMean = 32;
  static constexpr int kSteady = 8;

  absl::Duration latency_;
  std::optional<absl::Duration> last_;
  int count_ = 0;         // of gaps, up to kMean + 1
  absl::Duration usual_;  // from one image to the next
  absl::Duration lag_;    // what the images may be behind
  int steady_ = 0;        // usual gaps in a row
  absl::Duration late_until_ = -absl::InfiniteDuration();
};

}  // namespace silhouette
