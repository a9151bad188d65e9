// SPDX-License-Identifier: Apache-2.0
// Lateness: how long what a device sends was held up on its way, by the device's own clock.
#pragma once

#include <algorithm>
#include <optional>

#include "absl/time/time.h"

namespace silhouette {

// A network or a machine that stands still, or is too slow, delivers images late that carry the
// times at which they were taken. The device's clock may begin anywhere. A plain value.
class Lateness {
 public:
  // `sent`: by the device's clock; `arrived`: by the running clock. How much longer it was under
  // way than the quickest so far, beyond what the clocks may have run apart.
  absl::Duration Of(absl::Duration sent, absl::Duration arrived) {
    const absl::Duration delay = arrived - sent;
    if (least_) *least_ += kDrift * std::max(arrived - last_arrived_, absl::ZeroDuration());
    last_arrived_ = arrived;
    least_ = std::min(least_.value_or(delay), delay);
    Watch(sent);
    return delay - *least_;
  }

  // Whether the quickest is known: for a second nothing was clearly quicker than all before. If
  // not, what had piled up when the stream began may still be read, faster than it was sent.
  bool settled() const { return settled_; }

 private:
  // Of a clock that is slewed (NTP: 500 ppm at most), against another one.
  static constexpr double kDrift = 1e-3;
  static constexpr absl::Duration kWatched = absl::Seconds(1);  // of the device's clock
  static constexpr absl::Duration kClearly = absl::Milliseconds(10);
  // Of a stream that settled, whose times must have jumped: its images come irregularly.
  static constexpr absl::Duration kJump = absl::Milliseconds(100);

  void Watch(absl::Duration sent) {
    const bool quicker = !watched_ || *least_ < *watched_ - (settled_ ? kJump : kClearly);
    if (!quicker && sent - watched_since_ < kWatched) return;
    settled_ = !quicker;
    watched_ = least_;
    watched_since_ = sent;
  }

  std::optional<absl::Duration> least_;    // delay, of unknown zero
  std::optional<absl::Duration> watched_;  // least_ when the watch began
  absl::Duration watched_since_;           // sent
  absl::Duration last_arrived_;
  bool settled_ = false;
};

}  // namespace silhouette
