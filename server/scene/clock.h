// SPDX-License-Identifier: Apache-2.0
// Time in the server: the wall clock, for people and time stamps, and the running clock, by which
// everything is ordered and ages.
#pragma once

#include <algorithm>
#include <functional>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/devices/running_clock.h"

namespace silhouette {

struct Moment {
  absl::Time time;         // wall clock; may be set at any time, in either direction
  absl::Duration running;  // RunningNow(): since some fixed instant; never steps
};

// Returns the present moment; may be called from any thread.
using Clock = std::function<Moment()>;

// How far two readings of both clocks, which are read one after the other, may disagree.
inline constexpr absl::Duration kClockJitter = absl::Microseconds(100);

inline Moment SystemClock() {
  constexpr int kAttempts = 4;  // a thread may pause between the two readings, but rarely again
  for (int attempt = 1;; ++attempt) {
    const absl::Duration before = RunningNow();
    const absl::Time time = absl::Now();
    if (attempt == kAttempts || RunningNow() - before <= kClockJitter) return {time, before};
  }
}

// The moment that the wall clock stamped `time`, given the reading `now` of both clocks. Right if
// the wall clock has not been set between the stamp and `now`.
inline Moment MomentOf(absl::Time time, const Moment& now) {
  return {time, now.running - (now.time - time)};
}

// The same of a stamp made between the readings `before` and `after`: if the wall clock was set
// between these, the earlier of the two moments that the stamp can mean.
inline Moment MomentOf(absl::Time time, const Moment& before, const Moment& after) {
  return {time, std::min(MomentOf(time, before).running, MomentOf(time, after).running)};
}

}  // namespace silhouette
