#include "capture/session/still_images.h"

#include <algorithm>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace silhouette {

bool ImagesDiffer(const cv::Mat& before, const cv::Mat& after, const Reference& reference,
                  const SegmentationSettings& settings) {
  if (before.size() != reference.size() || after.size() != reference.size()) {
    throw std::invalid_argument("images and reference of a view differ in size");
  }
  cv::Mat first;
  cv::Mat second;
  Grey(before).convertTo(first, CV_32F);
  Grey(after).convertTo(second, CV_32F);
  const double dark = cv::mean(first)[0];
  const double gain = dark > 0 && settings.follow_brightness ? cv::mean(second)[0] / dark : 1;
  cv::Mat difference;
  cv::addWeighted(second, 1, first, -gain, 0, difference);
  cv::Mat least;
  reference.AsGrey().noise().convertTo(
      least, CV_32F, settings.noise_factor * std::numbers::sqrt2 / Reference::kGreyLevel);
  least = cv::max(least, settings.min_difference);
  const cv::Mat changed = cv::abs(difference) > least;
  cv::Mat labels;
  cv::Mat areas;
  cv::Mat centres;
  const int count = cv::connectedComponentsWithStats(changed, labels, areas, centres);
  for (int area = 1; area < count; ++area) {  // 0: what did not change
    if (areas.at<int>(area, cv::CC_STAT_AREA) >= std::max(settings.min_blob_pixels, 1)) return true;
  }
  return false;
}

}  // namespace silhouette
