// SPDX-License-Identifier: Apache-2.0
// RecentMean: a camera's recent images as one image with less noise, where nothing changes.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/reference.h"

namespace silhouette {

// Not thread-safe.
class RecentMean {
 public:
  // The time constant of the mean, seconds.
  static constexpr double kMemory = 0.4;

  // The mean of `image`, which was taken `seconds` after the one before, and of those before, pixel
  // by pixel: begun again at `image` where that is more than four standard deviations of the
  // reference's noise away from the mean, and everywhere after a gap of kMemory. So no pixel of the
  // result is farther than that from the image. 8-bit, as the image. Throws std::invalid_argument
  // if image and reference differ in size or channels.
  cv::Mat Add(const cv::Mat& image, const Reference& reference, double seconds);

 private:
  cv::Mat mean_;    // 16-bit, in 256ths of a grey level
  cv::Mat images_;  // 8-bit: how many are in it, up to kMostImages
};

}  // namespace silhouette
