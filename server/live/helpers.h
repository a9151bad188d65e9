// SPDX-License-Identifier: Apache-2.0
// The same work again and again: with pauses, and on several things at once.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/live/live_settings.h"
#include "server/scene/clock.h"

namespace silhouette {

// How long to wait before a device that failed is asked again: twice as long each time.
class Backoff {
 public:
  Backoff(absl::Duration first, absl::Duration longest)
      : first_(first), longest_(longest), next_(first) {}

  absl::Duration Next() { return std::exchange(next_, std::min(2 * next_, longest_)); }
  void Reset() { next_ = first_; }

 private:
  absl::Duration first_;
  absl::Duration longest_;
  absl::Duration next_;
};

// Calls `ask`, which asks a device, until it is to stop. Begins a call `interval` after the last
// one began; after an error, which `failed` gets, it waits by a Backoff from first_retry to
// longest_retry. Calls `close` when there were only errors for reopen_after. An exception that
// leaves `ask` is an error.
void AskAgainAndAgain(const std::stop_token& stop, const Clock& clock, const LiveSettings& settings,
                      absl::Duration interval, const std::function<absl::Status()>& ask,
                      const std::function<void(const absl::Status&)>& failed,
                      const std::function<void()>& close);

// Threads that wait for work: waking one takes less time than starting one for each set of images.
class Helpers {
 public:
  // `threads`: in all, with the one that calls ForEach(); less than 2: none is started.
  explicit Helpers(int threads);

  // Does `work(i)` for each i below `count`, in this thread and the helpers. Returns when all is
  // done. `work` must not throw. One call at a time.
  void ForEach(size_t count, const std::function<void(size_t)>& work);

 private:
  void Help(const std::stop_token& stop);
  // What is left, one by one; `lock` holds the mutex but for the work itself.
  void DoWhatIsLeft(std::unique_lock<std::mutex>& lock);

  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::condition_variable_any idle_;
  const std::function<void(size_t)>* work_ = nullptr;
  size_t next_ = 0;
  size_t count_ = 0;
  int busy_ = 0;                       // helpers
  std::vector<std::jthread> threads_;  // last: they use the others
};

}  // namespace silhouette
