// SPDX-License-Identifier: Apache-2.0
// The clock for waiting and for ages: it never steps, whatever happens to the wall clock.
#pragma once

#include <chrono>

#include "absl/time/time.h"

namespace silhouette {

// Since some fixed instant.
inline absl::Duration RunningNow() {
  return absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

}  // namespace silhouette
