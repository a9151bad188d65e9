// SPDX-License-Identifier: Apache-2.0
// Robot images that are probably wrong: the robot reported a wrong pose, a camera delivered a wrong
// image, or the light changed. Recapture them.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"
#include "db/store/statistics.h"
#include "db/store/store.h"

namespace silhouette {

enum class OutlierReason {
  kDamaged,           // the record cannot be read
  kEmpty,             // no robot in the view
  kTouchesBorder,     // the robot must be whole in every view (section 2)
  kUnlikeNeighbours,  // its mask differs more from its neighbours' than they do from each other
};

// "damaged", "empty", "touches-border", "unlike-neighbours".
std::string NameOf(OutlierReason reason);

struct Outlier {
  ConfigurationNumber number = 0;
  OutlierReason reason = OutlierReason::kDamaged;
  int view = -1;  // index; -1: all
  bool operator==(const Outlier&) const = default;
};

struct OutlierSettings {
  // A mask that differs by less from what its neighbours let expect is never unlike them: this
  // many pixels, and this share of the larger of two masks' areas.
  double least_pixels = 12;
  double least_share = 0.15;
};

// All outliers in the order of numbers; one configuration can be there for several views, excluded
// ones never are. A mask is compared with its neighbours along each joint, and is unlike them if
// most joints say so. Touching the border is mended by moving the camera, not by a new capture.
// Cancelled if `progress` said so. Holds at most some 256 MiB of records in memory.
absl::StatusOr<std::vector<Outlier>> FindOutliers(const Snapshot& snapshot,
                                                  const ConfigurationGrid& grid,
                                                  const OutlierSettings& settings = {},
                                                  const WorkProgress& progress = nullptr);

}  // namespace silhouette
