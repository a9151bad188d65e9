// OpenCV's images as those of cameras.
#pragma once

#include <opencv2/core.hpp>

#include "absl/time/time.h"
#include "capture/devices/devices.h"

namespace silhouette {

// `image` is of 8 bits, grey or blue, green, red.
inline CameraImage CameraImageOf(const cv::Mat& image, absl::Time captured) {
  CameraImage result{.width = image.cols,
                     .height = image.rows,
                     .channels = image.channels(),
                     .pixels = {},
                     .captured = captured};
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  result.pixels.assign(whole.datastart, whole.dataend);
  return result;
}

}  // namespace silhouette
