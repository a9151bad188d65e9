// SPDX-License-Identifier: Apache-2.0
// What settings make of images, in figures.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/segmentation/difference.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"
#include "db/store/store.h"

namespace silhouette {

// The images that silhouette-capture tune looks at.

struct TuneImage {
  std::string name;  // "17, top" or "pictures/top.png"
  int view = 0;
  cv::Mat image;
  std::shared_ptr<const Reference> reference;
  bool empty = false;            // nothing but the cell is in it: all foreground is false
  std::optional<Mask> recorded;  // of the database's robot image
};

// The raw images of at most `most` configurations, spread over those that have some, in all views,
// with the references that they were taken with. DataLoss if one cannot be read.
absl::StatusOr<std::vector<TuneImage>> RawImagesToTune(const Database& database, int most);

// The images in a folder, VIEW.png, VIEW.jpg or VIEW.jpeg for each view that has one, with the
// database's references. NotFound if there are none; InvalidArgument, naming the file, if one
// cannot be read or is not of its view's size.
absl::StatusOr<std::vector<TuneImage>> FolderImagesToTune(const Database& database,
                                                          const std::string& folder, bool empty);

// The settings that silhouette-capture tune compares.

struct TuneVariant {
  std::string name;  // what was asked for, e.g. "faint_side: 7"
  SegmentationSettings settings;
};

// First what the database's masks were made with, then those of the cell file where they differ;
// then one for each of `tries`, keys of the section `segmentation` that change those of the cell
// file. Without tries a lower and a higher value of each setting that matters. InvalidArgument,
// naming it, if one of `tries` has unknown keys, is not valid, or changes nothing.
absl::StatusOr<std::vector<TuneVariant>> TuneVariants(const storage::v1::CellDescription& database,
                                                      const SegmentationSettings& of_cell_file,
                                                      const std::vector<std::string>& tries);

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
