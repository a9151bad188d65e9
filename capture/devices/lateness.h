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
  // way than the quickest so far, beyond what the clocks may have run apart. Nothing: not known. It
  // is the first, or quicker than all before by more than half of the time since the last one was
  // sent: then what had piled up when the stream began is still being read.
  std::optional<absl::Duration> Of(absl::Duration sent, absl::Duration arrived) {
    const absl::Duration delay = arrived - sent;
    const bool first = !least_;
    if (!first) *least_ += kDrift * std::max(arrived - last_arrived_, absl::ZeroDuration());
    const bool draining = !first && delay < *least_ - (sent - last_sent_) / 2;
    last_sent_ = sent;
    last_arrived_ = arrived;
    least_ = std::min(least_.value_or(delay), delay);
    if (first || draining) return std::nullopt;
    return delay - *least_;
  }

 private:
  // Of a clock that is slewed (NTP: 500 ppm at most), against another one.
  static constexpr double kDrift = 1e-3;

  std::optional<absl::Duration> least_;  // delay, of unknown zero
  absl::Duration last_sent_;
  absl::Duration last_arrived_;
};

}  // namespace silhouette
