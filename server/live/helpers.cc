// SPDX-License-Identifier: Apache-2.0
#include "server/live/helpers.h"

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>

#include "absl/strings/str_cat.h"

namespace silhouette {

namespace {

// Waits so long, or until it is to stop.
void Pause(const std::stop_token& stop, absl::Duration time) {
  if (time <= absl::ZeroDuration()) return;
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, stop, absl::ToChronoNanoseconds(time), [] { return false; });
}

}  // namespace

void AskAgainAndAgain(const std::stop_token& stop, const Clock& clock, const LiveSettings& settings,
                      absl::Duration interval, const std::function<absl::Status()>& ask,
                      const std::function<void(const absl::Status&)>& failed,
                      const std::function<void()>& close) {
  Backoff backoff(settings.first_retry, settings.longest_retry);
  absl::Duration last_good = clock().running;
  while (!stop.stop_requested()) {
    const absl::Duration begun = clock().running;
    absl::Status status;
    try {
      status = ask();
    } catch (const std::exception& error) {
      status = absl::InternalError(absl::StrCat("internal error: ", error.what()));
    }
    const absl::Duration now = clock().running;
    if (status.ok()) {
      last_good = now;
      backoff.Reset();
      Pause(stop, interval - (now - begun));
      continue;
    }
    failed(status);
    if (now - last_good > settings.reopen_after) {
      close();
      last_good = now;
    }
    Pause(stop, backoff.Next());
  }
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
