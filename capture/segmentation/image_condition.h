// SPDX-License-Identifier: Apache-2.0
// What an image is beside its reference as a whole: its light, the cell's structure in it, and
// where that is.
#pragma once

#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "capture/segmentation/reference.h"

namespace silhouette {

// A small grey copy of a reference, about kWidth pixels wide, and where it has structure. Cannot be
// changed once made.
class Outline {
 public:
  static constexpr int kWidth = 80;

  explicit Outline(const Reference& reference);

  // Camera pixels per pixel.
  int scale() const { return scale_; }
  // Whether an image beside it tells of its structure and place; of its light. Not if the reference
  // is too plain; if it is dark, saturated or undefined everywhere.
  bool tells_structure() const;
  bool tells_light() const;

 private:
  friend class OutlineComparison;

  cv::Size image_size_;
  int scale_ = 1;
  cv::Mat mean_;     // 32-bit grey levels, smoothed
  cv::Mat slope_x_;  // grey levels per pixel
  cv::Mat slope_y_;
  cv::Mat known_;                 // 8-bit; 0: undefined, dark or saturated somewhere
  std::vector<cv::Rect> blocks_;  // with structure
};

struct ImageCondition {
  // How many times as bright as the reference, by the median pixel. What is brighter than the
  // camera shows makes it too small.
  double gain = 1;
  // Share of the pixels that are saturated.
  double saturated = 0;
  // Share of the reference's blocks with structure that the image has with their structure (its
  // slopes correlate with theirs by kSameStructure at least): 1 if it is the cell; 0 if it has
  // another structure. Of the blocks that are not foreground: what people hide does not count. Of
  // all, if fewer than two are left. Nothing: the cell is too plain to say.
  std::optional<double> structure = std::nullopt;
  // By how many camera pixels the structure has moved, root mean square over the image. Found by
  // least squares over the blocks that roughly have it; if few have, by trying, too.
  double shift = 0;
  // The view whose reference has the image's structure, where it is not the image's own.
  std::optional<size_t> other = std::nullopt;
};

inline constexpr double kSameStructure = 0.7;

// The condition of an image of the view `view`. `foreground`: the image's, 8-bit, not 0 where it
// is. `outlines`: of all views. `image`: 8-bit, grey or blue, green, red. Both of the size of the
// view's reference; else std::invalid_argument.
ImageCondition ConditionOf(const cv::Mat& image, const cv::Mat& foreground,
                           std::span<const Outline> outlines, size_t view);

}  // namespace silhouette
