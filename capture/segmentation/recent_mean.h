// SPDX-License-Identifier: Apache-2.0
// RecentMean: a camera's recent images as one image with less noise, where nothing changes.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/reference.h"

namespace silhouette {

// Not thread-safe.
class RecentMean {
 public:
  // The mean is that of the first so many images; each later one weighs as one of so many.
  static constexpr int kImages = 8;

  // The mean of `image` and those before it, pixel by pixel: begun again at `image` where it is
  // more than four standard deviations of the reference's noise away from the mean. So no pixel of
  // the result is further than that from the image. 8-bit, as the image. Throws
  // std::invalid_argument if image and reference differ in size or channels.
  cv::Mat Add(const cv::Mat& image, const Reference& reference);

 private:
  cv::Mat mean_;    // 16-bit, in 256ths of a grey level
  cv::Mat images_;  // 8-bit: how many are in it, up to kImages
};

}  // namespace silhouette
