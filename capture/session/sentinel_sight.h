// One sentinel in one view: how it looks now against how it looked at first.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "capture/segmentation/reference.h"
#include "capture/session/image_shift.h"
#include "db/mask/mask.h"

namespace silhouette {

// What a view showed of a sentinel.
struct SentinelImage {
  cv::Mat grey;  // empty: the image was not kept
  Mask mask;
};

struct Sight {
  // Of what stands still, and of the robot; nothing: not to be told.
  std::optional<ImageShift> background;
  std::optional<ImageShift> robot;
  double gain = 1;      // how many times as bright
  int mask_pixels = 0;  // by which the masks differ
  int core_pixels = 0;  // of these: not next to the other mask
  int mask_area = 0;    // at first
};

// `reference` is the view's.
Sight Compare(const SentinelImage& first, const SentinelImage& now, const Reference& reference);

// What `sight` says against the view, in one sentence without its subject, e.g. "moved by 7.2 px to
// the right and 0.4 px down"; empty: nothing. `most_shift`: camera pixels that are none.
std::string Complaint(const Sight& sight, double most_shift);

}  // namespace silhouette
