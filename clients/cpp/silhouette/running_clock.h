// SPDX-License-Identifier: Apache-2.0
// The clock by which the client ages what the server says.
#pragma once

#include <time.h>

#include <chrono>

namespace silhouette::client {

// Never steps, and runs on while the computer sleeps, unlike std::chrono::steady_clock: after a
// pause of any kind, what was free before is as old as it really is. A clock of the standard
// library's kind (TrivialClock); Linux's CLOCK_BOOTTIME.
struct RunningClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<RunningClock>;
  static constexpr bool is_steady = true;

  static time_point now() noexcept {
    timespec now{};
    clock_gettime(CLOCK_BOOTTIME, &now);
    return time_point(std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec));
  }
};

}  // namespace silhouette::client
