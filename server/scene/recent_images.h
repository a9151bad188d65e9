// SPDX-License-Identifier: Apache-2.0
// The last images of one view: noise makes every image another one, so a camera that repeats one of
// them, or a ring of them, is frozen.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <unordered_set>

namespace silhouette {

// Not thread-safe.
class RecentImages {
 public:
  static constexpr size_t kRemembered = 1024;

  // Whether the image with this digest is one of the last kRemembered; it is one of them from now
  // on.
  bool Repeats(uint64_t digest) {
    if (!known_.insert(digest).second) return true;
    order_.push_back(digest);
    if (order_.size() > kRemembered) {
      known_.erase(order_.front());
      order_.pop_front();
    }
    return false;
  }

 private:
  std::unordered_set<uint64_t> known_;
  std::deque<uint64_t> order_;  // the same, oldest first
};

}  // namespace silhouette
