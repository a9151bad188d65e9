// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/difference.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace silhouette {
namespace {

constexpr double kUnit = 1.0 / Reference::kGreyLevel;
constexpr double kTiny = 1e-6;
constexpr double kClosenessMostSquared = 64;  // grey levels; more counts as that in squares
constexpr double kClosenessUnsteady =
    3;  // times the typical noise: squares of noisier pixels are none

// One channel as floating-point grey levels.
struct Channel {
  cv::Mat difference;
  cv::Mat noise;
};

std::vector<Channel> ChannelsOf(const cv::Mat& image, const Reference& reference,
                                const Brightness& brightness) {
  std::vector<cv::Mat> levels;
  std::vector<cv::Mat> means;
  std::vector<cv::Mat> noises;
  cv::split(image, levels);
  cv::split(reference.mean(), means);
  cv::split(reference.noise(), noises);
  std::vector<Channel> channels(levels.size());
  for (size_t c = 0; c < channels.size(); ++c) {
    cv::Mat expected;
    means[c].convertTo(expected, CV_32F, kUnit * brightness.gain, brightness.offset);
    expected = cv::min(cv::max(expected, 0), 255);
    cv::Mat& difference = channels[c].difference;
    cv::subtract(levels[c], expected, difference, cv::noArray(), CV_32F);
    const cv::Mat saturated = means[c] >= Reference::kSaturated * Reference::kGreyLevel;
    cv::Mat(cv::min(difference, 0)).copyTo(difference, saturated);
    noises[c].convertTo(channels[c].noise, CV_32F, kUnit);
  }
  return channels;
}

// Sums over the surroundings of what is open.
class Around {
 public:
  Around(const cv::Mat& open, int side) : open_(open), side_(side) {
    number_ = Sum(cv::Mat(open.size(), CV_32FC1, cv::Scalar(1)));
    enough_ = number_ > side * side / 2;
    number_ = cv::max(number_, 1);
    cv::sqrt(number_, root_);
  }
  cv::Mat Mean(const cv::Mat& values) const { return Sum(values) / number_; }
  const cv::Mat& root() const { return root_; }  // of the number of values
  const cv::Mat& enough() const { return enough_; }

 private:
  cv::Mat Sum(const cv::Mat& values) const {
    cv::Mat sum = cv::Mat::zeros(open_.size(), CV_32FC1);
    values.copyTo(sum, open_);
    cv::boxFilter(sum, sum, CV_32F, {side_, side_}, {-1, -1}, false, cv::BORDER_CONSTANT);
    return sum;
  }

  cv::Mat open_;
  int side_;
  cv::Mat number_;
  cv::Mat root_;
  cv::Mat enough_;
};

// `value` in times of the greater of two limits.
cv::Mat Over(const cv::Mat& value, const cv::Mat& limit, double least) {
  const cv::Mat allowed = cv::max(cv::max(limit, least), kTiny);
  return value / allowed;
}

cv::Mat MeanOverLimit(const Channel& channel, const Around& around,
                      const SegmentationSettings& settings) {
  const cv::Mat noise = settings.noise_factor * around.Mean(channel.noise) / around.root();
  return Over(cv::abs(around.Mean(channel.difference)), noise, settings.faint_difference);
}

cv::Mat TextureOverLimit(const Channel& channel, const Around& around, double steady,
                         const SegmentationSettings& settings) {
  const auto square = [&](const cv::Mat& values) {
    cv::Mat squared = cv::min(cv::abs(values), kClosenessMostSquared);
    squared = squared.mul(squared);
    squared.setTo(0, channel.noise > steady);
    return around.Mean(squared);
  };
  const cv::Mat variance = square(channel.noise);
  const cv::Mat beyond = cv::max(square(channel.difference) - variance, 0);
  const cv::Mat uncertain = std::sqrt(2) * settings.noise_factor * variance / around.root();
  cv::Mat over = Over(beyond, uncertain, settings.texture_difference * settings.texture_difference);
  cv::sqrt(over, over);
  return over;
}

}  // namespace

cv::Mat DifferenceOverLimit(const cv::Mat& image, const Reference& reference,
                            const Brightness& brightness, const SegmentationSettings& settings) {
  const std::vector<Channel> channels = ChannelsOf(image, reference, brightness);
  cv::Mat over = cv::Mat::zeros(image.size(), CV_32FC1);
  for (const Channel& channel : channels) {
    const cv::Mat noise = settings.noise_factor * channel.noise;
    over = cv::max(over, Over(cv::abs(channel.difference), noise, settings.min_difference));
  }
  if (!reference.undefined().empty()) over.setTo(kFarBeyond, reference.undefined());
  const Around around(over <= 1, settings.faint_side);
  const double steady = std::max(kClosenessUnsteady * reference.typical_noise() * kUnit, 1.0);
  for (const Channel& channel : channels) {
    cv::Mat faint = cv::Mat::zeros(image.size(), CV_32FC1);
    if (settings.faint_difference > 0) faint = MeanOverLimit(channel, around, settings);
    if (settings.texture_difference > 0) {
      faint = cv::max(faint, TextureOverLimit(channel, around, steady, settings));
    }
    cv::max(over, faint, faint);
    faint.copyTo(over, around.enough());
  }
  return cv::min(over, kFarBeyond);
}

}  // namespace silhouette
