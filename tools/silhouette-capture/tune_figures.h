// What settings make of images, in figures.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "capture/segmentation/difference.h"
#include "tools/silhouette-capture/tune_images.h"
#include "tools/silhouette-capture/tune_variants.h"

namespace silhouette {

// Of an image, or summed over several. Gained and lost: against the first variant.
struct TuneFigures {
  int64_t pixels = 0;  // of the camera images
  int64_t foreground = 0;
  int64_t areas = 0;   // of foreground that hangs together, over edges and corners
  int64_t specks = 0;  // pixels that differ, and were dropped by the clean-up or as a small area
  int64_t close = 0;   // pixels that differ by 0.7 to 1.4 times their limit
  int64_t gained = 0;
  int64_t lost = 0;
  int64_t empty_pixels = 0;  // of images of the empty cell
  int64_t false_pixels = 0;  // foreground in these
  int64_t mask_pixels = 0;   // that are set
  int64_t mask_gained = 0;
  int64_t mask_lost = 0;
  int64_t recorded = 0;  // mask pixels of the recorded masks, and what is added and taken away
  int64_t recorded_added = 0;
  int64_t recorded_removed = 0;

  void Add(const TuneFigures& other);
};

struct TunedImage {
  std::vector<ForegroundSteps> steps;  // by variant
  std::vector<TuneFigures> figures;
};

// `mask_size`: of the image's view. Throws std::invalid_argument as Foreground() does.
TunedImage Tune(const TuneImage& image, const std::vector<TuneVariant>& variants,
                MaskSize mask_size);

}  // namespace silhouette
