// How many verdicts were told, by what they say.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "server/collision/verdict.h"

namespace silhouette {

// Thread-safe.
class VerdictCounts {
 public:
  void Add(State state, Reason reason, uint64_t verdicts = 1) {
    counts_[Place(state, reason)].fetch_add(verdicts, std::memory_order_relaxed);
  }
  void Add(const Verdict& verdict) { Add(verdict.state(), verdict.reason()); }

  // `told(state, reason, verdicts)` for all that were told at least once.
  template <typename Told>
  void ForEach(const Told& told) const {
    for (size_t place = 0; place < counts_.size(); ++place) {
      const uint64_t verdicts = counts_[place].load(std::memory_order_relaxed);
      if (verdicts == 0) continue;
      told(static_cast<State>(place / kReasons), static_cast<Reason>(place % kReasons), verdicts);
    }
  }

 private:
  static constexpr size_t kReasons = 32;  // more than there are
  static constexpr size_t kStates = 3;

  static size_t Place(State state, Reason reason) {
    return static_cast<size_t>(state) * kReasons + static_cast<size_t>(reason);
  }

  std::array<std::atomic<uint64_t>, kStates * kReasons> counts_{};
};

}  // namespace silhouette
