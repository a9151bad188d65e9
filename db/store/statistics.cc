// SPDX-License-Identifier: Apache-2.0
#include "db/store/statistics.h"

#include <algorithm>
#include <utility>

#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<DatabaseStatistics> StatisticsOf(const Snapshot& snapshot,
                                                const ConfigurationGrid& grid,
                                                const std::vector<MaskSize>& mask_sizes,
                                                const WorkProgress& progress) {
  DatabaseStatistics statistics;
  for (MaskSize size : mask_sizes) {
    ViewStatistics& view = statistics.views.emplace_back();
    view.permanent = Mask(size);
    view.ever = Mask(size);
  }
  std::vector<double> areas(mask_sizes.size(), 0);
  uint64_t done = 0;
  bool cancelled = false;
  const auto visit = [&](ConfigurationNumber, const absl::StatusOr<RobotImage>& image) {
    if (!image.ok()) {
      ++statistics.damaged;
    } else if (image->excluded) {
      ++statistics.excluded;
    } else {
      const bool first = statistics.captured++ == 0;
      for (size_t i = 0; i < mask_sizes.size(); ++i) {
        const Mask& mask = image->masks[i];
        ViewStatistics& view = statistics.views[i];
        const size_t area = mask.Count();
        view.least_area = first ? area : std::min(view.least_area, area);
        view.greatest_area = std::max(view.greatest_area, area);
        view.permanent = first ? mask : view.permanent & mask;
        view.ever = view.ever | mask;
        areas[i] += static_cast<double>(area);
      }
    }
    cancelled = progress && !progress(++done);
    return !cancelled;
  };
  RETURN_IF_ERROR(snapshot.ForEach(visit));
  if (cancelled) return absl::CancelledError("stopped");
  for (size_t i = 0; i < areas.size() && statistics.captured > 0; ++i) {
    statistics.views[i].mean_area = areas[i] / static_cast<double>(statistics.captured);
  }
  const uint64_t records = statistics.captured + statistics.excluded + statistics.damaged;
  statistics.missing = grid.size() - std::min(records, grid.size());
  return statistics;
}

}  // namespace silhouette
