// SPDX-License-Identifier: Apache-2.0
#include "server/live/helpers.h"

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

Helpers::Helpers(int threads) {
  for (int i = 1; i < threads; ++i) {
    threads_.emplace_back([this](const std::stop_token& stop) { Help(stop); });
  }
}

void Helpers::ForEach(size_t count, const std::function<void(size_t)>& work) {
  std::unique_lock lock(mutex_);
  work_ = &work;
  next_ = 0;
  count_ = count;
  wake_.notify_all();
  DoWhatIsLeft(lock);
  idle_.wait(lock, [this] { return busy_ == 0; });
}

void Helpers::Help(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (wake_.wait(lock, stop, [this] { return next_ < count_; })) {
    ++busy_;
    DoWhatIsLeft(lock);
    --busy_;
    if (busy_ == 0) idle_.notify_all();
  }
}

void Helpers::DoWhatIsLeft(std::unique_lock<std::mutex>& lock) {
  while (next_ < count_) {
    const size_t i = next_++;
    lock.unlock();
    (*work_)(i);
    lock.lock();
  }
}

}  // namespace silhouette
