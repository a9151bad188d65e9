// SPDX-License-Identifier: Apache-2.0
// One sentinel in one view: how it looks now against how it looked at first.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "capture/segmentation/reference.h"
#include "db/mask/mask.h"

namespace silhouette {

// By how many pixels an image has moved since another was taken.

// To the right and down; a positive x says that what `now` shows lies further to the right.
struct ImageShift {
  double x = 0;
  double y = 0;
  double error = 0;  // standard error of either, by what is left unexplained

  double length() const;
};

// Where there is something to see in `first`: at least half a grey level of contrast on the whole,
// and an error below a quarter of a pixel. Phase correlation finds the shift, least squares over
// what does not stick out refine it; a shift is believed only if it explains the image better than
// none. `first`, `now`: 8-bit grey of one size, with `gain` the factor from one to the other's
// brightness; `region`: 8-bit, not 0 where pixels count.
std::optional<ImageShift> ShiftBetween(const cv::Mat& first, const cv::Mat& now,
                                       const cv::Mat& region, double gain);

// The shift of the whole region, or that of one of its quarters if that is clearly larger: that
// finds a camera that turned about its axis, too. Nothing if none of them can be measured.
std::optional<ImageShift> LargestShift(const cv::Mat& first, const cv::Mat& now,
                                       const cv::Mat& region, double gain);

// What a view showed of a sentinel.
struct SentinelImage {
  cv::Mat grey;  // empty: the image was not kept
  Mask mask;
};

struct Sight {
  // Of what stands still, and of the robot; nothing: it cannot be found.
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
