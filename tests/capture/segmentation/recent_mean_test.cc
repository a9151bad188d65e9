// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/recent_mean.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "tests/capture/segmentation/images.h"
#include "tests/random.h"

namespace silhouette {
namespace {

constexpr double kSigma = 3;
constexpr double kGap = 0.04;  // seconds between images

class RecentMeanTest : public testing::Test {
 protected:
  // Root mean square difference, grey levels.
  static double Difference(const cv::Mat& image, const cv::Mat& light) {
    cv::Mat levels;
    image.convertTo(levels, CV_64F);
    return cv::norm(levels, light, cv::NORM_L2) / std::sqrt(static_cast<double>(light.total()));
  }

  Random random_;
  const cv::Mat cell_ = EmptyCell({160, 120});
  const Reference reference_ = Reference::FromImages(ExposeSeries(cell_, 20, kSigma, random_));
  RecentMean recent_;
};

TEST_F(RecentMeanTest, NoiseOfAStillSceneFalls) {
  cv::Mat mean;
  for (int i = 0; i < 64; ++i) {
    mean = recent_.Add(Expose(cell_, 1, kSigma, random_), reference_, kGap);
  }
  EXPECT_LT(Difference(mean, cell_), kSigma / 3);
}

TEST_F(RecentMeanTest, NothingIsFartherFromTheImageThanFourStandardDeviations) {
  std::uniform_real_distribution<double> level(0, 255);
  std::uniform_int_distribution<int> place(0, 100);
  const double farthest = 4 * cv::norm(reference_.noise(), cv::NORM_INF) / Reference::kGreyLevel;
  for (int i = 0; i < 100; ++i) {
    cv::Mat light = cell_.clone();
    light(cv::Rect(place(random_), place(random_), 20, 20)) = level(random_);
    const cv::Mat image = Expose(light + 0.3 * i, 1, kSigma, random_);
    EXPECT_LE(cv::norm(recent_.Add(image, reference_, kGap), image, cv::NORM_INF), farthest + 1);
  }
}

TEST_F(RecentMeanTest, WhatComesIsInItAtOnce) {
  for (int i = 0; i < 40; ++i) recent_.Add(Expose(cell_, 1, kSigma, random_), reference_, kGap);
  cv::Mat light = cell_.clone();
  const cv::Rect box(50, 30, 60, 50);
  light(box) = 230;
  const cv::Mat image = Expose(light, 1, kSigma, random_);
  EXPECT_TRUE(SamePixels(recent_.Add(image, reference_, kGap)(box), image(box)));
}

TEST_F(RecentMeanTest, NothingIsLeftOfImagesBeforeAGap) {
  for (int i = 0; i < 40; ++i) recent_.Add(Expose(cell_, 1, kSigma, random_), reference_, kGap);
  const cv::Mat image = Expose(cell_, 1, kSigma, random_);
  EXPECT_TRUE(SamePixels(recent_.Add(image, reference_, RecentMean::kMemory), image));
}

TEST_F(RecentMeanTest, ImageOfAnotherKindIsRefused) {
  EXPECT_THROW(recent_.Add(cv::Mat(120, 150, CV_8UC1), reference_, kGap), std::invalid_argument);
  EXPECT_THROW(recent_.Add(cv::Mat(120, 160, CV_8UC3), reference_, kGap), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
