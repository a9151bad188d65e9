#include "server/live/pause.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>

namespace silhouette {

void Pause(const std::stop_token& stop, absl::Duration time) {
  if (time <= absl::ZeroDuration()) return;
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, stop, absl::ToChronoNanoseconds(time), [] { return false; });
}

absl::Duration Backoff::Next() {
  const absl::Duration wait = next_;
  next_ = std::min(2 * next_, longest_);
  return wait;
}

}  // namespace silhouette
