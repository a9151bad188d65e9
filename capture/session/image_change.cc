// SPDX-License-Identifier: Apache-2.0
#include "capture/session/image_change.h"

#include <algorithm>
#include <cstring>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

namespace silhouette {
namespace {

// The standard deviation of normally distributed values whose sizes most of these are: a minority
// of others does not count.
double TypicalDeviation(const cv::Mat& sizes) {
  constexpr double kDeviationOfMedian = 1.4826;
  std::vector<float> values(sizes.begin<float>(), sizes.end<float>());
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return kDeviationOfMedian * *middle;
}

// By how many grey levels the pixels differ.
cv::Mat GreyDifference(const cv::Mat& before, const cv::Mat& after, bool follow_brightness) {
  cv::Mat first;
  cv::Mat second;
  Grey(before).convertTo(first, CV_32F);
  Grey(after).convertTo(second, CV_32F);
  const double dark = cv::mean(first)[0];
  const double gain = dark > 0 && follow_brightness ? cv::mean(second)[0] / dark : 1;
  cv::Mat difference;
  cv::addWeighted(second, 1, first, -gain, 0, difference);
  return cv::abs(difference);
}

}  // namespace

cv::Mat ChangedAreas(const cv::Mat& before, const cv::Mat& after, const Reference* reference,
                     const SegmentationSettings& settings, int least_pixels) {
  if (before.size() != after.size() ||
      (reference != nullptr && before.size() != reference->size())) {
    throw std::invalid_argument("images and reference of a view differ in size");
  }
  const cv::Mat difference = GreyDifference(before, after, settings.follow_brightness);
  cv::Mat least;
  if (reference != nullptr) {
    reference->AsGrey().noise().convertTo(
        least, CV_32F, settings.noise_factor * std::numbers::sqrt2 / Reference::kGreyLevel);
  } else {
    least = cv::Mat(difference.size(), CV_32F,
                    cv::Scalar(settings.noise_factor * TypicalDeviation(difference)));
  }
  least = cv::max(least, settings.min_difference);
  const cv::Mat changed = difference > least;
  cv::Mat labels;
  cv::Mat areas;
  cv::Mat centres;
  const int count = cv::connectedComponentsWithStats(changed, labels, areas, centres);
  cv::Mat large = cv::Mat::zeros(changed.size(), CV_8UC1);
  for (int area = 1; area < count; ++area) {  // 0: what did not change
    if (areas.at<int>(area, cv::CC_STAT_AREA) < std::max(least_pixels, 1)) continue;
    large.setTo(255, labels == area);
  }
  return large;
}

bool SameImage(const cv::Mat& before, const cv::Mat& after) {
  if (before.size() != after.size() || before.type() != after.type()) return false;
  const size_t bytes = before.elemSize() * static_cast<size_t>(before.cols);
  for (int y = 0; y < before.rows; ++y) {
    if (std::memcmp(before.ptr(y), after.ptr(y), bytes) != 0) return false;
  }
  return true;
}

bool ImagesDiffer(const cv::Mat& before, const cv::Mat& after, const Reference* reference,
                  const SegmentationSettings& settings) {
  return cv::countNonZero(
             ChangedAreas(before, after, reference, settings, settings.min_blob_pixels)) > 0;
}

}  // namespace silhouette
