// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/recent_mean.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>

namespace silhouette {

cv::Mat RecentMean::Add(const cv::Mat& image, const Reference& reference, double seconds) {
  constexpr int kFarthest = 4;  // standard deviations of the noise
  constexpr int kMostImages = 32;
  // Images in the mean, at the most: the newest weighs 1 / most.
  const auto most = static_cast<int>(
      std::clamp(kMemory / std::max(seconds, kMemory / kMostImages), 1.0, double(kMostImages)));
  if (image.size() != reference.size() || image.depth() != CV_8U ||
      image.channels() != reference.channels()) {
    throw std::invalid_argument("image and reference are not of one size and kind");
  }
  const int channels = image.channels();
  if (mean_.size() != image.size() || mean_.channels() != channels) {
    image.convertTo(mean_, CV_MAKETYPE(CV_16U, channels), Reference::kGreyLevel);
    images_ = cv::Mat::zeros(image.size(), CV_8UC1);
  }
  cv::Mat result(image.size(), image.type());
  for (int y = 0; y < image.rows; ++y) {
    const auto* seen = image.ptr<uint8_t>(y);
    const auto* noise = reference.noise().ptr<uint16_t>(y);
    auto* mean = mean_.ptr<uint16_t>(y);
    auto* images = images_.ptr<uint8_t>(y);
    auto* out = result.ptr<uint8_t>(y);
    for (int x = 0; x < image.cols; ++x) {
      bool changed = false;
      for (int i = x * channels; i < (x + 1) * channels; ++i) {
        changed |= std::abs(seen[i] * Reference::kGreyLevel - mean[i]) > kFarthest * noise[i];
      }
      images[x] = changed ? 1 : static_cast<uint8_t>(std::min(images[x] + 1, most));
      for (int i = x * channels; i < (x + 1) * channels; ++i) {
        const int own = seen[i] * Reference::kGreyLevel;
        mean[i] = static_cast<uint16_t>(mean[i] + (own - mean[i]) / images[x]);
        out[i] =
            static_cast<uint8_t>((mean[i] + Reference::kGreyLevel / 2) / Reference::kGreyLevel);
      }
    }
  }
  return result;
}

}  // namespace silhouette
