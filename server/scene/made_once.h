// SPDX-License-Identifier: Apache-2.0
// Values that are made when they are first asked for.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/collision/stop.h"

namespace silhouette {

// One value. Used by any number of threads. A copy starts empty.
template <typename T>
class MadeOnce {
 public:
  MadeOnce() = default;
  MadeOnce(const MadeOnce&) {}
  MadeOnce& operator=(const MadeOnce&) = delete;

  // What `make()` returned the first time.
  template <typename Make>
  const T& Get(const Make& make) const {
    std::call_once(once_, [&] {
      value_.emplace(make());
      ready_.store(true, std::memory_order_release);
    });
    return *value_;
  }

  // Null while it has not been made.
  const T* made() const { return ready_.load(std::memory_order_acquire) ? &*value_ : nullptr; }

 private:
  mutable std::once_flag once_;
  mutable std::optional<T> value_;
  mutable std::atomic<bool> ready_ = false;
};

// A value per key, of which there are few: all are kept. Used by any number of threads. A copy
// starts empty.
template <typename Key, typename T>
class EachMadeOnce {
 public:
  EachMadeOnce() = default;
  EachMadeOnce(const EachMadeOnce&) {}
  EachMadeOnce& operator=(const EachMadeOnce&) = delete;

  // What `make()` returned the first time for this key.
  template <typename Make>
  const T& Get(const Key& key, const Make& make) const {
    const MadeOnce<T>* value = nullptr;
    {
      const std::lock_guard lock(mutex_);
      value = &values_[key];
    }
    return value->Get(make);
  }

 private:
  mutable std::mutex mutex_;
  mutable std::map<Key, MadeOnce<T>> values_;
};

// A value for each tile of a grid. Used by any number of threads.
template <typename T>
class TilesMadeOnce {
 public:
  explicit TilesMadeOnce(uint64_t tiles)
      : values_(tiles), steps_(std::make_unique<std::atomic<Step>[]>(tiles)) {}

  uint64_t size() const { return values_.size(); }

  // Whether the tile's value has been made.
  bool ready(uint64_t tile) const {
    return steps_[tile].load(std::memory_order_acquire) == Step::kReady;
  }

  // What `make(tile)`, an optional<T>, was the first time that it was one. Null if it is none now:
  // it was given up; or if another thread makes it and `stop` says so meanwhile.
  template <typename Make>
  const T* Get(uint64_t tile, const Stop& stop, const Make& make) const {
    if (ready(tile)) return &values_[tile];
    {
      std::unique_lock lock(mutex_);
      while (steps_[tile] == Step::kMaking) {
        changed_.wait_for(lock, std::chrono::milliseconds(5));
        if (steps_[tile] == Step::kMaking && Stopped(stop)) return nullptr;
      }
      if (ready(tile)) return &values_[tile];
      steps_[tile] = Step::kMaking;
    }
    const EndOfMaking end{*this, tile};  // of an exception, too
    std::optional<T> made = make(tile);
    if (!made) return nullptr;
    values_[tile] = *std::move(made);
    steps_[tile].store(Step::kReady, std::memory_order_release);
    return &values_[tile];
  }

  // Makes the values of these tiles, as Get. False if it was given up; what is ready stays so.
  template <typename Make>
  bool WorkOut(std::span<const uint64_t> tiles, const Stop& stop, const Make& make) const {
    return std::ranges::all_of(tiles, [&](uint64_t tile) {
      return ready(tile) || (!Stopped(stop) && Get(tile, stop, make) != nullptr);
    });
  }

 private:
  enum class Step : uint8_t { kNone, kMaking, kReady };

  struct EndOfMaking {
    const TilesMadeOnce& tiles;
    uint64_t tile;

    ~EndOfMaking() {
      const std::lock_guard lock(tiles.mutex_);
      if (tiles.steps_[tile] == Step::kMaking) tiles.steps_[tile] = Step::kNone;
      tiles.changed_.notify_all();
    }
  };

  mutable std::vector<T> values_;
  std::unique_ptr<std::atomic<Step>[]> steps_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
};

}  // namespace silhouette
