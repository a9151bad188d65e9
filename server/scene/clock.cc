#include "server/scene/clock.h"

#include <chrono>

#include "absl/time/clock.h"

namespace silhouette {

Moment SystemClock() {
  const auto running = std::chrono::steady_clock::now().time_since_epoch();
  return {absl::Now(), absl::FromChrono(running)};
}

}  // namespace silhouette
