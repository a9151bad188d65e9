// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/down_sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "tests/random.h"

namespace silhouette {
namespace {

// The same from the definition: the foreground's share of the mask pixel's rectangle, which is
// summed over the overlaps with all camera pixels.
bool IsSet(const cv::Mat& foreground, MaskSize size, double min_cover, int mask_x, int mask_y) {
  const auto overlap = [](int camera, int mask, int camera_pixels, int mask_pixels) {
    const int begin = std::max(camera * mask_pixels, mask * camera_pixels);
    const int end = std::min((camera + 1) * mask_pixels, (mask + 1) * camera_pixels);
    return std::max(end - begin, 0);
  };
  double area = 0;
  for (int y = 0; y < foreground.rows; ++y) {
    for (int x = 0; x < foreground.cols; ++x) {
      if (foreground.at<uint8_t>(y, x) == 0) continue;
      area += static_cast<double>(overlap(x, mask_x, foreground.cols, size.width)) *
              overlap(y, mask_y, foreground.rows, size.height);
    }
  }
  return area > min_cover * foreground.cols * foreground.rows;
}

TEST(DownSample, AgreesWithTheDefinition) {
  Random random;
  const auto up_to = [&](int limit) { return static_cast<int>(random() % uint64_t(limit)) + 1; };
  for (int round = 0; round < 60; ++round) {
    cv::Mat foreground(up_to(40), up_to(40), CV_8UC1);
    const uint64_t rarity = 1 + random() % 30;
    for (auto it = foreground.begin<uint8_t>(); it != foreground.end<uint8_t>(); ++it) {
      *it = random() % rarity == 0 ? 255 : 0;
    }
    const MaskSize size{up_to(45), up_to(45)};
    const double min_cover = round % 2 == 0 ? 0 : static_cast<double>(random() % 100) / 101;
    const Mask mask = DownSample(foreground, size, min_cover);
    ASSERT_EQ(mask,
              Mask::FromPredicate(
                  size, [&](int x, int y) { return IsSet(foreground, size, min_cover, x, y); }))
        << foreground.size() << " to " << size.width << " x " << size.height << ", min_cover "
        << min_cover;
  }
}

TEST(DownSample, OnePixelSetsEveryMaskPixelThatItTouches) {
  cv::Mat foreground = cv::Mat::zeros(4, 5, CV_8UC1);
  foreground.at<uint8_t>(0, 2) = 255;  // spans 0.4 to 0.6 of the width
  const Mask mask = DownSample(foreground, {2, 2}, 0);
  EXPECT_TRUE(mask.at(0, 0));
  EXPECT_TRUE(mask.at(1, 0));
  EXPECT_FALSE(mask.at(0, 1));
  EXPECT_FALSE(mask.at(1, 1));
}

TEST(DownSample, NeighbourAcrossAnEdgeIsNotTouched) {
  cv::Mat foreground = cv::Mat::zeros(10, 10, CV_8UC1);
  foreground.at<uint8_t>(4, 4) = 1;
  EXPECT_EQ(DownSample(foreground, {2, 2}, 0).Count(), 1u);
}

TEST(DownSample, MinCoverIsAShareThatMustBeExceeded) {
  cv::Mat foreground = cv::Mat::zeros(2, 2, CV_8UC1);
  foreground.at<uint8_t>(0, 0) = 255;
  EXPECT_EQ(DownSample(foreground, {1, 1}, 0.24).Count(), 1u);
  EXPECT_EQ(DownSample(foreground, {1, 1}, 0.25).Count(), 0u);
}

TEST(DownSample, WrongInputIsRefused) {
  const cv::Mat foreground = cv::Mat::zeros(2, 2, CV_8UC1);
  EXPECT_THROW(DownSample(cv::Mat(), {1, 1}, 0), std::invalid_argument);
  EXPECT_THROW(DownSample(cv::Mat::zeros(2, 2, CV_8UC3), {1, 1}, 0), std::invalid_argument);
  EXPECT_THROW(DownSample(foreground, {0, 1}, 0), std::invalid_argument);
  EXPECT_THROW(DownSample(foreground, {1, 1}, 1), std::invalid_argument);
  EXPECT_THROW(DownSample(foreground, {1, 1}, -0.1), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
