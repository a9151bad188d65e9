// SPDX-License-Identifier: Apache-2.0
// Figures about the robot images of a database: how many, how large, what the robot always covers.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"
#include "db/store/store.h"

namespace silhouette {

struct ViewStatistics {
  // Pixels of the robot per image; 0 if there is no image.
  size_t least_area = 0;
  size_t greatest_area = 0;
  double mean_area = 0;
  // Pixels that the robot covers in every image, and in at least one. Without an image both are
  // empty.
  Mask permanent;
  Mask ever;
};

struct DatabaseStatistics {
  uint64_t captured = 0;
  uint64_t excluded = 0;
  uint64_t damaged = 0;  // records that cannot be read
  uint64_t missing = 0;  // configurations without a record
  std::vector<ViewStatistics> views;
};

// Called after each record with their number so far; false ends the work.
using WorkProgress = std::function<bool(uint64_t done)>;

// Reads every record once. Cancelled if `progress` said so.
absl::StatusOr<DatabaseStatistics> StatisticsOf(const Snapshot& snapshot,
                                                const ConfigurationGrid& grid,
                                                const std::vector<MaskSize>& mask_sizes,
                                                const WorkProgress& progress = nullptr);

}  // namespace silhouette
