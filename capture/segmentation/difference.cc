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
  not_negative(settings.faint_difference, "faint_difference");
  not_negative(settings.clean_up_radius, "clean_up_radius");
  not_negative(settings.min_blob_pixels, "min_blob_pixels");
}

// `grey` less `gain` times the reference's mean, in grey levels.
cv::Mat DifferenceOf(const cv::Mat& grey, const Reference& reference, double gain) {
  const auto factor = static_cast<float>(gain / Reference::kGreyLevel);
  cv::Mat difference(grey.size(), CV_32FC1);
  for (int y = 0; y < grey.rows; ++y) {
    const auto* image = grey.ptr<uint8_t>(y);
    const auto* mean = reference.mean().ptr<uint16_t>(y);
    auto* out = difference.ptr<float>(y);
    for (int x = 0; x < grey.cols; ++x) {
      // A camera shows nothing brighter than 255.
      const float expected = std::min(factor * static_cast<float>(mean[x]), 255.0F);
      out[x] = static_cast<float>(image[x]) - expected;
    }
  }
  return difference;
}

// 255 where a pixel's difference is more than the settings allow.
cv::Mat Threshold(const cv::Mat& difference, const Reference& reference,
                  const SegmentationSettings& settings) {
  const auto noise_factor = static_cast<float>(settings.noise_factor / Reference::kGreyLevel);
  const auto least = static_cast<float>(settings.min_difference);
  cv::Mat foreground(difference.size(), CV_8UC1);
  for (int y = 0; y < difference.rows; ++y) {
    const auto* value = difference.ptr<float>(y);
    const auto* noise = reference.noise().ptr<uint16_t>(y);
    auto* out = foreground.ptr<uint8_t>(y);
    for (int x = 0; x < difference.cols; ++x) {
      const float allowed = std::max(noise_factor * static_cast<float>(noise[x]), least);
      out[x] = std::abs(value[x]) > allowed ? 255 : 0;
    }
  }
  return foreground;
}

// Adds the pixels whose surroundings differ in the mean. Foreground pixels have no part in the
// mean, for one that differs much would spread; nor has what is beyond the image's rim.
void AddFaint(const cv::Mat& difference, const Reference& reference,
              const SegmentationSettings& settings, cv::Mat& foreground) {
  if (settings.faint_difference == 0) return;
  constexpr int kSide = SegmentationSettings::kFaintSide;
  constexpr float kFewest = kSide * kSide / 2.0F;  // fewer pixels than that tell nothing
  const cv::Mat open = foreground == 0;
  cv::Mat sum = cv::Mat::zeros(difference.size(), CV_32FC1);
  cv::Mat noise = cv::Mat::zeros(difference.size(), CV_32FC1);
  cv::Mat count = cv::Mat::zeros(difference.size(), CV_32FC1);
  difference.copyTo(sum, open);
  cv::Mat all_noise;
  reference.noise().convertTo(all_noise, CV_32F, 1.0 / Reference::kGreyLevel);
  all_noise.copyTo(noise, open);
  count.setTo(1, open);
  for (cv::Mat* each : {&sum, &noise, &count}) {
    cv::boxFilter(*each, *each, CV_32F, {kSide, kSide}, {-1, -1}, false, cv::BORDER_CONSTANT);
  }
  const auto factor = static_cast<float>(settings.noise_factor);
  const auto least = static_cast<float>(settings.faint_difference);
  for (int y = 0; y < difference.rows; ++y) {
    const auto* sums = sum.ptr<float>(y);
    const auto* noises = noise.ptr<float>(y);
    const auto* counts = count.ptr<float>(y);
    auto* out = foreground.ptr<uint8_t>(y);
    for (int x = 0; x < difference.cols; ++x) {
      if (counts[x] < kFewest) continue;
      // The mean of `count` pixels has the noise of one over the root of `count`.
      const float allowed = std::max(factor * noises[x] / std::sqrt(counts[x]), least * counts[x]);
      if (std::abs(sums[x]) > allowed) out[x] = 255;
    }
  }
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
  const cv::Mat difference = DifferenceOf(grey, reference, gain);
  cv::Mat foreground = Threshold(difference, reference, settings);
  AddFaint(difference, reference, settings, foreground);
  CleanUp(foreground, settings.clean_up_radius);
  DropSmallBlobs(foreground, settings.min_blob_pixels);
  return foreground;
}

Mask Difference(const cv::Mat& image, const Reference& reference,
                const SegmentationSettings& settings, MaskSize mask_size) {
  return DownSample(Foreground(image, reference, settings), mask_size, settings.min_cover);
}

}  // namespace silhouette
