// How long something took, again and again.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/time/time.h"

namespace silhouette {

struct LatencyFigures {
  // Of all.
  uint64_t count = 0;
  absl::Duration sum;
  // Per bound of LatencyRecord::kBounds: how many were not longer.
  std::vector<uint64_t> within;
  // Of the newest LatencyRecord::kNewest; zero if there is none.
  absl::Duration median;
  absl::Duration p99;
  absl::Duration longest;
};

// Not thread-safe.
class LatencyRecord {
 public:
  static constexpr size_t kNewest = 4096;
  // Seconds, ascending.
  static constexpr std::array<double, 12> kBounds = {0.001, 0.002, 0.003, 0.005, 0.0075, 0.01,
                                                     0.015, 0.02,  0.03,  0.05,  0.1,    0.5};

  void Add(absl::Duration latency);
  LatencyFigures Figures() const;

 private:
  uint64_t count_ = 0;
  absl::Duration sum_;
  std::array<uint64_t, kBounds.size()> within_{};
  std::vector<absl::Duration> newest_;  // a ring
};

}  // namespace silhouette
