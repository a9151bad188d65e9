#include "capture/segmentation/difference.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "capture/segmentation/brightness.h"
#include "capture/segmentation/closeness.h"
#include "capture/segmentation/deviating_pixels.h"
#include "capture/segmentation/down_sampling.h"
#include "capture/segmentation/shadows.h"
#include "capture/segmentation/small_areas.h"

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
  not_negative(settings.texture_difference, "texture_difference");
  if (settings.faint_side < 3 || settings.faint_side > SegmentationSettings::kMostFaintSide ||
      settings.faint_side % 2 == 0) {
    throw std::invalid_argument("segmentation: faint_side must be an odd number from 3 to 15");
  }
  not_negative(settings.clean_up_radius, "clean_up_radius");
  not_negative(settings.min_blob_pixels, "min_blob_pixels");
}

void CleanUp(cv::Mat& foreground, int radius) {
  if (radius == 0) return;
  const int side = 2 * radius + 1;
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side});
  cv::morphologyEx(foreground, foreground, cv::MORPH_OPEN, disc);
  cv::morphologyEx(foreground, foreground, cv::MORPH_CLOSE, disc);
}

// Foreground(); `steps`, unless null, is told the steps.
cv::Mat Find(const cv::Mat& image, const Reference& reference, const SegmentationSettings& settings,
             const SlowLight& slow_light, ForegroundSteps* steps) {
  Validate(settings);
  const cv::Mat grey = reference.channels() == 1 ? Grey(image) : image;
  if (grey.size() != reference.size()) {
    throw std::invalid_argument(absl::StrCat("the camera image has ", grey.cols, " x ", grey.rows,
                                             " pixels, its reference ", reference.size().width,
                                             " x ", reference.size().height));
  }
  if (grey.type() == CV_8UC1 && reference.channels() == 3) {
    return Find(grey, reference.AsGrey(), settings, slow_light, steps);
  }
  const Brightness brightness =
      settings.follow_brightness ? BrightnessOf(grey, reference, slow_light) : Brightness{};
  cv::Mat foreground = DeviatingPixels(grey, reference, brightness, slow_light, settings);
  if (steps != nullptr) {
    steps->over_limit = DifferenceOverLimit(grey, reference, brightness, settings);
    steps->deviating = foreground.clone();
  }
  if (settings.shadows == Shadows::kIgnore) {
    DropShadows(grey, reference, brightness, slow_light, foreground);
  }
  if (steps != nullptr) steps->no_shadow = foreground.clone();
  CleanUp(foreground, settings.clean_up_radius);
  DropSmallAreas(foreground, settings.min_blob_pixels);
  if (!reference.undefined().empty()) foreground |= reference.undefined();
  if (steps != nullptr) steps->foreground = foreground;
  return foreground;
}

}  // namespace

cv::Mat Foreground(const cv::Mat& image, const Reference& reference,
                   const SegmentationSettings& settings, const SlowLight& slow_light) {
  return Find(image, reference, settings, slow_light, nullptr);
}

ForegroundSteps StepsToForeground(const cv::Mat& image, const Reference& reference,
                                  const SegmentationSettings& settings) {
  ForegroundSteps steps;
  Find(image, reference, settings, {}, &steps);
  return steps;
}

Mask Difference(const cv::Mat& image, const Reference& reference,
                const SegmentationSettings& settings, MaskSize mask_size,
                const SlowLight& slow_light) {
  return DownSample(Foreground(image, reference, settings, slow_light), mask_size,
                    settings.min_cover);
}

}  // namespace silhouette
