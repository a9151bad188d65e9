// SPDX-License-Identifier: Apache-2.0
// Values that are made when they are first asked for.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

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
    std::call_once(once_, [&] { value_.emplace(make()); });
    return *value_;
  }

 private:
  mutable std::once_flag once_;
  mutable std::optional<T> value_;
};

// A value for each tile of a grid. Used by any number of threads.
template <typename T>
class TilesMadeOnce {
 public:
  explicit TilesMadeOnce(uint64_t tiles)
      : values_(tiles),
        ready_(std::make_unique<std::atomic<bool>[]>(tiles)),
        once_(std::make_unique<std::once_flag[]>(tiles)) {}

  uint64_t size() const { return values_.size(); }

  // Whether the tile's value has been made.
  bool ready(uint64_t tile) const { return ready_[tile].load(std::memory_order_acquire); }

  // What `make(tile)` returned the first time.
  template <typename Make>
  const T& Get(uint64_t tile, const Make& make) const {
    if (!ready(tile)) {
      std::call_once(once_[tile], [&] {
        values_[tile] = make(tile);
        ready_[tile].store(true, std::memory_order_release);
      });
    }
    return values_[tile];
  }

 private:
  mutable std::vector<T> values_;
  std::unique_ptr<std::atomic<bool>[]> ready_;
  std::unique_ptr<std::once_flag[]> once_;
};

}  // namespace silhouette
