// SPDX-License-Identifier: Apache-2.0
// Rebuilds masks from the camera images that a database kept, with other settings: the masks that a
// capture with these settings would have made. Nothing moves.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/segmentation/settings.h"
#include "db/store/store.h"

namespace silhouette {

struct RemaskOptions {
  SegmentationSettings segmentation;
  // Whether robot images without raw images are left out, rather than refused.
  bool leave_out = false;
  // Called on the calling thread now and again; false stops.
  std::function<bool(uint64_t done, uint64_t total)> progress = nullptr;
};

// How the masks of a view changed. Of masks of another size nothing is counted.
struct ViewChange {
  std::string name;
  uint64_t images = 0;  // masks that are not what they were
  uint64_t added = 0;   // pixels, all masks together
  uint64_t removed = 0;
  uint64_t before = 0;  // pixels that there were
};

// What was made of a variant.
struct RemaskedVariant {
  std::string name;
  uint64_t configurations = 0;  // whose masks were made
  uint64_t excluded = 0;
  uint64_t left_out = 0;
  std::vector<ViewChange> views;
};

// Makes the masks of all variants and writes them into `into`, a new database of the same grid and
// views, with masks of whatever sizes it has; variants that it lacks are made. `program`: for its
// provenance log. What is excluded is excluded there, what is suspect is suspect. Memory: some
// hundred robot images at a time. FailedPrecondition, with their number, if robot images have no
// raw images and are not to be left out; DataLoss if one cannot be read; Cancelled if `progress`
// said so; InvalidArgument if a setting is not valid; errors of writing. Nothing else may write
// into `database` meanwhile.
absl::StatusOr<std::vector<RemaskedVariant>> Remask(const Database& database,
                                                    const RemaskOptions& options,
                                                    const std::string& program, Database& into);

}  // namespace silhouette
