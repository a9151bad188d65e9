// Masks made anew from the camera images that a database kept, with other settings, as a capture
// with these settings would have made them. Nothing moves.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/segmentation/settings.h"
#include "db/store.h"

namespace silhouette {

struct RemaskOptions {
  SegmentationSettings segmentation;
  // One per view.
  std::vector<MaskSize> mask_sizes;
  // Whether robot images without raw images are left out, rather than refused.
  bool leave_out = false;
  int threads = 2;
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

struct Remasked {
  // All records, those that are excluded as well, in order.
  std::vector<RobotImage> images;
  uint64_t excluded = 0;
  uint64_t left_out = 0;
  std::vector<ViewChange> views;
};

// FailedPrecondition, with their number, if robot images have no raw images and are not to be left
// out; DataLoss if one cannot be read; Cancelled if `progress` said so; InvalidArgument if a
// setting is not valid. Nobody writes into the database meanwhile.
absl::StatusOr<Remasked> Remask(const Database& database, const RemaskOptions& options);

}  // namespace silhouette
