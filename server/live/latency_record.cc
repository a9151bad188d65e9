#include "server/live/latency_record.h"

#include <algorithm>

namespace silhouette {

void LatencyRecord::Add(absl::Duration latency) {
  if (newest_.size() < kNewest) {
    newest_.push_back(latency);
  } else {
    newest_[count_ % kNewest] = latency;
  }
  ++count_;
  sum_ += latency;
  for (size_t i = 0; i < kBounds.size(); ++i) {
    if (latency <= absl::Seconds(kBounds[i])) ++within_[i];
  }
}

LatencyFigures LatencyRecord::Figures() const {
  LatencyFigures figures{.count = count_,
                         .sum = sum_,
                         .within = {within_.begin(), within_.end()},
                         .median = {},
                         .p99 = {},
                         .longest = {}};
  if (newest_.empty()) return figures;
  std::vector<absl::Duration> sorted = newest_;
  std::ranges::sort(sorted);
  // The least that this share of all does not exceed.
  const auto quantile = [&](size_t percent) {
    return sorted[(sorted.size() * percent + 99) / 100 - 1];
  };
  figures.median = quantile(50);
  figures.p99 = quantile(99);
  figures.longest = sorted.back();
  return figures;
}

}  // namespace silhouette
