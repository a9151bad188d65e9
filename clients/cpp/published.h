// SPDX-License-Identifier: Apache-2.0
// A value that one thread replaces while any number of threads read it.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>

namespace silhouette::client {

// Readers never wait: they increment a counter, take the pointer, and decrement the counter. The
// writer waits until no thread can still read the old value. It uses two counters by turns: new
// readers use the other one, so that they cannot delay the writer.
//
// T derives from std::enable_shared_from_this.
template <typename T>
class Published {
 public:
  explicit Published(std::shared_ptr<const T> first)
      : owner_(std::move(first)), current_(owner_.get()) {}

  // `read(value)`; the value stays valid during the call. Must be short: it delays the writer.
  template <typename Read>
  auto With(const Read& read) const {
    const Reader reader(readers_[turn_.load()]);
    return read(*current_.load());
  }

  // A reference to keep.
  std::shared_ptr<const T> Get() const {
    return With([](const T& value) { return value.shared_from_this(); });
  }

  // For one thread at a time.
  void Replace(std::shared_ptr<const T> next) {
    current_.store(next.get());
    const int turn = turn_.load();
    WaitForReaders(readers_[1 - turn]);
    turn_.store(1 - turn);
    WaitForReaders(readers_[turn]);
    owner_ = std::move(next);
  }

 private:
  class Reader {
   public:
    explicit Reader(std::atomic<int>& count) : count_(count) { count_.fetch_add(1); }
    ~Reader() { count_.fetch_sub(1, std::memory_order_release); }
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;

   private:
    std::atomic<int>& count_;
  };

  static void WaitForReaders(const std::atomic<int>& count) {
    for (int tries = 0; count.load() != 0; ++tries) {
      if (tries < 100) {
        std::this_thread::yield();
      } else {
        std::this_thread::sleep_for(std::chrono::microseconds(50));
      }
    }
  }

  std::shared_ptr<const T> owner_;
  std::atomic<const T*> current_;
  std::atomic<int> turn_ = 0;
  mutable std::atomic<int> readers_[2] = {0, 0};
};

}  // namespace silhouette::client
