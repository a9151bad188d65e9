// SPDX-License-Identifier: Apache-2.0
// The clock for waiting and for ages: it never steps, whatever happens to the wall clock, and runs
// on while the computer sleeps.
#pragma once

#include <time.h>

#include "absl/time/time.h"

namespace silhouette {

// Since some fixed instant (CLOCK_BOOTTIME).
inline absl::Duration RunningNow() {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return absl::DurationFromTimespec(now);
}

}  // namespace silhouette
