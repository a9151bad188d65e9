#include "capture/segmentation/difference.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "capture/segmentation/brightness.h"
#include "capture/segmentation/deviating_pixels.h"
#include "capture/segmentation/down_sampling.h"
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
  cv::Mat foreground = DeviatingPixels(grey, reference, gain, settings);
  CleanUp(foreground, settings.clean_up_radius);
  DropSmallAreas(foreground, settings.min_blob_pixels);
  return foreground;
}

Mask Difference(const cv::Mat& image, const Reference& reference,
                const SegmentationSettings& settings, MaskSize mask_size) {
  return DownSample(Foreground(image, reference, settings), mask_size, settings.min_cover);
}

}  // namespace silhouette
