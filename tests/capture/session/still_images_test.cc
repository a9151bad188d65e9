// SPDX-License-Identifier: Apache-2.0
// Two images of one view, one after the other.
#include "capture/session/image_change.h"
#include "tests/random.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace silhouette {
namespace {

constexpr double kNoise = 3;  // grey levels

cv::Mat NoisyImage(cv::RNG& random, int type, double brightness = 1) {
  cv::Mat image(60, 80, type);
  random.fill(image, cv::RNG::NORMAL, cv::Scalar::all(brightness * 100), cv::Scalar::all(kNoise));
  return image;
}

void ExpectJudged(int type) {
  cv::RNG random{Random()()};
  std::vector<cv::Mat> empty;
  for (int i = 0; i < 20; ++i) empty.push_back(NoisyImage(random, type));
  const Reference reference = Reference::FromImages(empty);
  const SegmentationSettings settings;
  for (int i = 0; i < 20; ++i) {
    const cv::Mat before = NoisyImage(random, type);
    EXPECT_FALSE(ImagesDiffer(before, NoisyImage(random, type), &reference, settings)) << "noise";
    EXPECT_FALSE(ImagesDiffer(before, NoisyImage(random, type, 1.2), &reference, settings))
        << "brightness";
    // An edge of the robot that has moved by a pixel.
    cv::Mat edge = NoisyImage(random, type);
    cv::rectangle(edge, {40, 20, 1, 15}, cv::Scalar::all(200), cv::FILLED);
    EXPECT_TRUE(ImagesDiffer(before, edge, &reference, settings)) << "edge";
    cv::Mat speck = NoisyImage(random, type);
    cv::rectangle(speck, {40, 20, 2, 2}, cv::Scalar::all(200), cv::FILLED);
    EXPECT_FALSE(ImagesDiffer(before, speck, &reference, settings)) << "speck";
  }
}

TEST(StillImages, OnlyWhatMovedDiffersInGrey) { ExpectJudged(CV_8UC1); }
TEST(StillImages, OnlyWhatMovedDiffersInColour) { ExpectJudged(CV_8UC3); }

TEST(StillImages, WithoutAReferenceTheImagesShowTheirNoise) {
  cv::RNG random{Random()()};
  for (int i = 0; i < 20; ++i) {
    const cv::Mat before = NoisyImage(random, CV_8UC1);
    EXPECT_FALSE(ImagesDiffer(before, NoisyImage(random, CV_8UC1), nullptr, {})) << "noise";
    cv::Mat edge = NoisyImage(random, CV_8UC1);
    cv::rectangle(edge, {40, 20, 1, 15}, cv::Scalar::all(200), cv::FILLED);
    EXPECT_TRUE(ImagesDiffer(before, edge, nullptr, {})) << "edge";
  }
}

TEST(StillImages, OtherSizesAreRefused) {
  cv::RNG random(1);
  const std::vector<cv::Mat> empty = {NoisyImage(random, CV_8UC1), NoisyImage(random, CV_8UC1)};
  const Reference reference = Reference::FromImages(empty);
  const cv::Mat small = cv::Mat::zeros(5, 5, CV_8UC1);
  EXPECT_THROW(ImagesDiffer(empty[0], small, &reference, {}), std::invalid_argument);
  EXPECT_THROW(ImagesDiffer(empty[0], small, nullptr, {}), std::invalid_argument);
  EXPECT_THROW(ImagesDiffer(small, small, &reference, {}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
