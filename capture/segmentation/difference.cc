#include "capture/segmentation/difference.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "absl/strings/str_cat.h"
#include "capture/segmentation/brightness.h"
#include "capture/segmentation/down_sampling.h"

namespace silhouette {
namespace {

void Validate(const SegmentationSettings& settings) {
  const auto not_negative = [](double value, const char* name) {
    if (!(value >= 0 && std::isfinite(value))) {
      throw std::invalid_argument(absl::StrCat("segmentation: ", name, " must not be below 0"));
    }
  };
  not_negative(settings.noise_factor, "noise_factor");
  not_negative(settings.min_difference, "min_difference");
  not_negative(settings.clean_up_radius, "clean_up_radius");
  not_negative(settings.min_blob_pixels, "min_blob_pixels");
}

// 255 where `grey` differs from `gain` times the reference by more than the settings allow.
cv::Mat Threshold(const cv::Mat& grey, const Reference& reference,
                  const SegmentationSettings& settings, double gain) {
  constexpr float kUnit = 1.0F / Reference::kGreyLevel;
  const auto mean_factor = static_cast<float>(gain * kUnit);
  const auto noise_factor = static_cast<float>(settings.noise_factor * kUnit);
  const auto least = static_cast<float>(settings.min_difference);
  cv::Mat foreground(grey.size(), CV_8UC1);
  for (int y = 0; y < grey.rows; ++y) {
    const auto* image = grey.ptr<uint8_t>(y);
    const auto* mean = reference.mean().ptr<uint16_t>(y);
    const auto* noise = reference.noise().ptr<uint16_t>(y);
    auto* out = foreground.ptr<uint8_t>(y);
    for (int x = 0; x < grey.cols; ++x) {
      // A camera shows nothing brighter than 255.
      const float expected = std::min(mean_factor * static_cast<float>(mean[x]), 255.0F);
      const float difference = std::abs(static_cast<float>(image[x]) - expected);
      const float allowed = std::max(noise_factor * static_cast<float>(noise[x]), least);
      out[x] = difference > allowed ? 255 : 0;
    }
  }
  return foreground;
}

void CleanUp(cv::Mat& foreground, int radius) {
  if (radius == 0) return;
  const int side = 2 * radius + 1;
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side});
  cv::morphologyEx(foreground, foreground, cv::MORPH_OPEN, disc);
  cv::morphologyEx(foreground, foreground, cv::MORPH_CLOSE, disc);
}

void DropSmallBlobs(cv::Mat& foreground, int min_pixels) {
  if (min_pixels <= 1) return;
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centroids;
  const int count =
      cv::connectedComponentsWithStats(foreground, labels, stats, centroids, 8, CV_32S);
  // By label; 0 is the background.
  std::vector<uint8_t> value(static_cast<size_t>(count), 0);
  bool any_small = false;
  for (int label = 1; label < count; ++label) {
    const bool keep = stats.at<int>(label, cv::CC_STAT_AREA) >= min_pixels;
    value[static_cast<size_t>(label)] = keep ? 255 : 0;
    any_small |= !keep;
  }
  if (!any_small) return;
  for (int y = 0; y < labels.rows; ++y) {
    const auto* label = labels.ptr<int>(y);
    auto* out = foreground.ptr<uint8_t>(y);
    for (int x = 0; x < labels.cols; ++x) out[x] = value[static_cast<size_t>(label[x])];
  }
}

}  // namespace

cv::Mat Foreground(const cv::Mat& image, const Reference& reference,
                   const SegmentationSettings& settings) {
  Validate(settings);
  const cv::Mat grey = Grey(image);
  if (grey.size() != reference.size()) {
    throw std::invalid_argument(absl::StrCat("the camera image has ", grey.cols, " x ", grey.rows,
                                             " pixels, its reference ", reference.size().width,
                                             " x ", reference.size().height));
  }
  const double gain = settings.follow_brightness ? BrightnessGain(grey, reference) : 1;
  cv::Mat foreground = Threshold(grey, reference, settings, gain);
  CleanUp(foreground, settings.clean_up_radius);
  DropSmallBlobs(foreground, settings.min_blob_pixels);
  return foreground;
}

Mask Difference(const cv::Mat& image, const Reference& reference,
                const SegmentationSettings& settings, MaskSize mask_size) {
  return DownSample(Foreground(image, reference, settings), mask_size, settings.min_cover);
}

}  // namespace silhouette
