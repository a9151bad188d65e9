// SPDX-License-Identifier: Apache-2.0
// The signals that end the server or make it load its database again.
#pragma once

#include <chrono>
#include <condition_variable>
#include <csignal>
#include <mutex>

namespace silhouette {

// The program's signals, taken by a thread of its own: none waits until other work is done. After
// SIGTERM or SIGINT the program has kLongestEnd to end by itself. Then this ends it with exit code
// 3, whatever hangs: a device, a disk, the log. A reload that hangs does not keep it. A second
// signal ends it at once, as the first one does while the database is loaded. Thread-safe.
class Signals {
 public:
  static constexpr std::chrono::milliseconds kLongestEnd{1900};

  // Before any thread is started, so that all leave the signals to this. To be kept until the
  // program ends.
  Signals();

  // From now on something must be ended.
  void Loaded();

  enum class Wish { kNone, kReload, kEnd };

  // Waits for `time` at most. kReload: SIGHUP came, once or more often.
  Wish Wait(std::chrono::seconds time);

  // Waits for SIGTERM or SIGINT.
  void AwaitEnd();

 private:
  [[noreturn]] void Take();

  sigset_t awaited_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool loading_ = true;
  bool reloading_ = false;
  bool ending_ = false;
};

}  // namespace silhouette
