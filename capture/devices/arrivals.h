// SPDX-License-Identifier: Apache-2.0
// Arrivals: whether what a device sends by itself comes late, by when it comes alone.
#pragma once

#include <algorithm>
#include <optional>

#include "absl/time/time.h"

namespace silhouette {

// A stream of images or of joint values that was held up, by a network or by this machine, delivers
// afterwards what has piled up, faster than it was made. A plain value.
class Arrivals {
 public:
  // Something arrived at `now`. A clock that steps back counts as standing still.
  void Note(absl::Duration now) {
    const absl::Duration gap = last_ ? now - *last_ : absl::ZeroDuration();
    if (gap >= absl::ZeroDuration() && gap < usual_ / 8) return;  // as good as together
    if (last_) NoteGap(std::max(gap, absl::ZeroDuration()));
    last_ = now;
  }

  // How long what arrived last may have been held up, beyond what is usual in this stream. In a
  // stream that is in time it is what its gaps vary by.
  absl::Duration lag() const { return lag_; }

 private:
  void NoteGap(absl::Duration gap) {
    count_ = std::min(count_ + 1, kMean + 1);
    lag_ = std::max(lag_ + gap - usual_, absl::ZeroDuration());
    if (count_ <= kMean) {
      usual_ += (gap - usual_) / count_;
    } else if (lag_ < 2 * usual_) {
      usual_ += (gap - usual_) / kMean;
    }
    EndLag(gap);
  }

  // If gaps are even for a while and not shorter than usual, nothing has piled up: the device
  // itself paused, or has become slower.
  void EndLag(absl::Duration gap) {
    longest_ = std::max(longest_, gap);
    sum_ += gap;
    if (++gaps_ < kWhile) return;
    const absl::Duration mean = sum_ / kWhile;
    const auto near = [&](absl::Duration other) {
      return absl::AbsDuration(mean - other) < other / 10;
    };
    const bool slower = mean > usual_ && near(mean_before_);
    if (longest_ < 2 * mean && (slower || near(usual_))) {
      if (slower && !near(usual_)) usual_ = mean;
      lag_ = absl::ZeroDuration();
    }
    mean_before_ = mean;
    longest_ = sum_ = absl::ZeroDuration();
    gaps_ = 0;
  }

  static constexpr int kMean = 32;
  static constexpr int kWhile = 8;

  std::optional<absl::Duration> last_;
  int count_ = 0;         // of gaps, up to kMean + 1
  absl::Duration usual_;  // mean gap of a stream that is in time
  absl::Duration lag_;    // sum of the gaps beyond the usual one

  // Of the last gaps, up to kWhile.
  int gaps_ = 0;
  absl::Duration sum_;
  absl::Duration longest_;
  absl::Duration mean_before_;  // of the kWhile before
};

}  // namespace silhouette
