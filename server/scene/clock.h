// SPDX-License-Identifier: Apache-2.0
// Time in the server: the wall clock, by which images are stamped, and a clock that never
// steps back, by which they age.
#pragma once

#include <chrono>
#include <functional>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace silhouette {

struct Moment {
  absl::Time time;         // wall clock
  absl::Duration running;  // since some fixed instant, whatever happens to the wall clock
};

// Returns the present moment; may be called from any thread.
using Clock = std::function<Moment()>;

inline Moment SystemClock() {
  const auto running = std::chrono::steady_clock::now().time_since_epoch();
  return {absl::Now(), absl::FromChrono(running)};
}

}  // namespace silhouette
