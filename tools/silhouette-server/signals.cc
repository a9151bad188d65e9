// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-server/signals.h"

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <cstdlib>
#include <string_view>
#include <thread>
#include <utility>

#include "tools/program/program.h"

namespace silhouette {

Signals::Signals() {
  sigemptyset(&awaited_);
  for (int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&awaited_, signal);
  pthread_sigmask(SIG_BLOCK, &awaited_, nullptr);
  std::thread([this] { Take(); }).detach();
}

void Signals::Loaded() {
  const std::lock_guard lock(mutex_);
  loading_ = false;
}

Signals::Wish Signals::Wait(std::chrono::seconds time) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, time, [this] { return ending_ || reloading_; });
  if (ending_) return Wish::kEnd;
  return std::exchange(reloading_, false) ? Wish::kReload : Wish::kNone;
}

void Signals::AwaitEnd() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return ending_; });
}

void Signals::Take() {
  int signal = SIGHUP;
  while (signal == SIGHUP) {
    if (sigwait(&awaited_, &signal) != 0) continue;
    const std::lock_guard lock(mutex_);
    if (signal != SIGHUP && loading_) std::_Exit(0);
    (signal == SIGHUP ? reloading_ : ending_) = true;
    changed_.notify_all();
  }
  sigdelset(&awaited_, SIGHUP);
  pthread_sigmask(SIG_UNBLOCK, &awaited_, nullptr);
  std::this_thread::sleep_for(kLongestEnd);
  // Not through the log, which may be what hangs.
  constexpr std::string_view kSaid = "silhouette-server: ended while something hangs\n";
  pollfd errors{.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
  if (poll(&errors, 1, /*timeout=*/0) == 1) {
    [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, kSaid.data(), kSaid.size());
  }
  std::_Exit(kWorldFailed);
}

}  // namespace silhouette
