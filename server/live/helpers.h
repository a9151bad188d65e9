// SPDX-License-Identifier: Apache-2.0
// The same work on several things at once, again and again.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "absl/time/time.h"

namespace silhouette {

// Waiting in a thread that may be asked to stop.
// Waits so long, or until it is to stop.
void Pause(const std::stop_token& stop, absl::Duration time);

// How long to wait before a device that failed is asked again: twice as long each time.
class Backoff {
 public:
  Backoff(absl::Duration first, absl::Duration longest)
      : first_(first), longest_(longest), next_(first) {}

  absl::Duration Next();
  void Reset() { next_ = first_; }

 private:
  absl::Duration first_;
  absl::Duration longest_;
  absl::Duration next_;
};

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
