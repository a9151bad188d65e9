// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/reference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "capture/segmentation/difference.h"
#include "tests/capture/segmentation/images.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

TEST(Reference, MeanIsThatOfTheImages) {
  const std::vector<cv::Mat> images = {cv::Mat(2, 3, CV_8UC1, cv::Scalar(10)),
                                       cv::Mat(2, 3, CV_8UC1, cv::Scalar(11)),
                                       cv::Mat(2, 3, CV_8UC1, cv::Scalar(15))};
  const Reference reference = Reference::FromImages(images);
  EXPECT_EQ(reference.size(), cv::Size(3, 2));
  EXPECT_EQ(reference.mean().at<uint16_t>(1, 2), 12 * Reference::kGreyLevel);
}

TEST(Reference, NoiseIsMeasured) {
  std::mt19937_64 random(1);
  const cv::Mat cell = EmptyCell({160, 120});
  for (const int count : {2, 5, 20, 100}) {
    const Reference reference = Reference::FromImages(ExposeSeries(cell, count, 2.0, random));
    const double mean = cv::mean(reference.noise())[0] / Reference::kGreyLevel;
    // Of a further image, and of what few images leave in the mean.
    const double further = 2.0 * std::sqrt(1 + 1.0 / count);
    EXPECT_NEAR(mean, further, 0.25) << count << " images";
    double least = 0;
    double greatest = 0;
    cv::minMaxLoc(reference.noise(), &least, &greatest);
    EXPECT_GT(least / Reference::kGreyLevel, 0.5 * further) << count << " images";
    EXPECT_LT(greatest / Reference::kGreyLevel, 2 * further) << count << " images";
  }
}

TEST(Reference, FlickeringPixelHasItsOwnNoise) {
  std::mt19937_64 random(2);
  std::vector<cv::Mat> images = ExposeSeries(EmptyCell({64, 48}), 20, 1.0, random);
  for (size_t i = 0; i < images.size(); ++i) images[i].at<uint8_t>(7, 9) = i % 2 == 0 ? 0 : 200;
  const Reference reference = Reference::FromImages(images);
  EXPECT_GT(reference.noise().at<uint16_t>(7, 9), 60 * Reference::kGreyLevel);
  EXPECT_LT(reference.noise().at<uint16_t>(7, 10), 3 * Reference::kGreyLevel);
}

TEST(Reference, PixelThatJumpedOnceIsAllowedTo) {
  std::mt19937_64 random(2);
  std::vector<cv::Mat> images = ExposeSeries(EmptyCell({64, 48}), 100, 1.0, random);
  const int level = images[0].at<uint8_t>(7, 9);
  images[40].at<uint8_t>(7, 9) = static_cast<uint8_t>(level + 40);
  const Reference reference = Reference::FromImages(images);
  EXPECT_GT(6 * reference.noise().at<uint16_t>(7, 9), 45 * Reference::kGreyLevel);
  EXPECT_EQ(reference.Describe().unsteady, 1);
}

TEST(Reference, ColourIsKept) {
  const cv::Mat colour(4, 4, CV_8UC3, cv::Scalar(10, 100, 200));  // blue, green, red
  const Reference reference = Reference::FromImages(std::vector<cv::Mat>{colour, colour});
  EXPECT_EQ(reference.channels(), 3);
  EXPECT_EQ((reference.mean().at<cv::Vec<uint16_t, 3>>(0, 0)),
            (cv::Vec<uint16_t, 3>(2560, 25600, 51200)));
  const auto read = Reference::FromPng(reference.MeanPng(), reference.NoisePng());
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(SamePixels(read->mean(), reference.mean()));
  EXPECT_FALSE(Reference::FromPng(reference.MeanPng(), reference.AsGrey().NoisePng()).ok());
}

TEST(Reference, AsGreyIsTheReferenceOfGreyImages) {
  std::mt19937_64 random(3);
  const cv::Mat cell = EmptyCell({64, 48});
  std::vector<cv::Mat> colour;
  std::vector<cv::Mat> grey;
  for (int i = 0; i < 60; ++i) {
    cv::Mat image;
    cv::merge(std::vector<cv::Mat>{Expose(cell, 0.8, 2, random), Expose(cell, 1, 2, random),
                                   Expose(cell, 1.2, 2, random)},
              image);
    grey.push_back(Grey(image));
    colour.push_back(std::move(image));
  }
  const Reference expected = Reference::FromImages(grey);
  const Reference reference = Reference::FromImages(colour).AsGrey();
  EXPECT_LT(cv::norm(reference.mean(), expected.mean(), cv::NORM_INF), 0.6 * Reference::kGreyLevel);
  EXPECT_NEAR(cv::mean(reference.noise())[0], cv::mean(expected.noise())[0],
              0.1 * Reference::kGreyLevel);
}

class ReferenceWithRobot : public testing::Test {
 protected:
  // A bright arm sweeps over the cell; its base stands in the corner, always.
  ReferenceWithRobot() {
    for (int i = 0; i < 16; ++i) {
      cv::Mat light = cell_.clone();
      cv::Mat covered = cv::Mat::zeros(light.size(), CV_8UC1);
      for (const cv::Rect& part : {cv::Rect(6 * i, 0, 20, 60), base_}) {
        light(part) = 220;
        covered(part) = 255;
      }
      images_.push_back(Expose(light, 1, 1.5, random_));
      covered_.push_back(covered);
    }
  }
  std::mt19937_64 random_{9};
  const cv::Rect base_{100, 60, 20, 20};
  const cv::Mat cell_ = EmptyCell({120, 80});
  std::vector<cv::Mat> images_;
  std::vector<cv::Mat> covered_;
};

TEST_F(ReferenceWithRobot, ShowsTheCellWhereTheRobotIsNot) {
  const std::vector<cv::Mat> unknown(images_.size());
  for (const std::vector<cv::Mat>& covered : {covered_, unknown}) {
    const Reference reference = Reference::FromImagesWithRobot(images_, covered);
    for (int y = 0; y < 80; ++y) {
      for (int x = 0; x < 120; ++x) {
        if (base_.contains({x, y})) continue;
        ASSERT_NEAR(reference.mean().at<uint16_t>(y, x) / 256.0, cell_.at<double>(y, x), 3)
            << x << ", " << y;
      }
    }
    EXPECT_NEAR(reference.Describe().mean_noise, 1.5, 0.4);
  }
}

TEST_F(ReferenceWithRobot, PixelThatIsAlwaysCoveredIsForegroundForEver) {
  const Reference reference = Reference::FromImagesWithRobot(images_, covered_);
  EXPECT_EQ(reference.Describe().undefined, base_.area());
  const auto stored = Reference::FromPng(reference.MeanPng(), reference.NoisePng());
  ASSERT_TRUE(stored.ok());
  for (const cv::Mat& light : {cell_, cv::Mat(cv::Mat::zeros(80, 120, CV_64FC1))}) {
    const cv::Mat foreground = Foreground(Expose(light, 1, 1.5, random_), *stored, {});
    EXPECT_EQ(cv::countNonZero(foreground(base_)), base_.area());
  }
  EXPECT_EQ(cv::countNonZero(Foreground(Expose(cell_, 1, 1.5, random_), *stored, {})),
            base_.area());
}

TEST_F(ReferenceWithRobot, PixelThatShowsMoreThanOneThingIsUndefined) {
  for (size_t i = 0; i < images_.size(); ++i) {
    images_[i].at<uint8_t>(70, 5) = static_cast<uint8_t>(15 * i);
  }
  const std::vector<cv::Mat> unknown(images_.size());
  const Reference reference = Reference::FromImagesWithRobot(images_, unknown);
  EXPECT_TRUE(reference.Describe().undefined <= 1);
  EXPECT_GT(reference.noise().at<uint16_t>(70, 5), 40 * Reference::kGreyLevel);
}

TEST_F(ReferenceWithRobot, TooFewImagesAreRefused) {
  images_.resize(4);
  covered_.resize(4);
  EXPECT_THROW(Reference::FromImagesWithRobot(images_, covered_), std::invalid_argument);
}

TEST(Reference, StoredReferenceIsTheSameToTheBit) {
  std::mt19937_64 random(3);
  const Reference reference =
      Reference::FromImages(ExposeSeries(EmptyCell({61, 47}), 7, 3.0, random));
  const auto read = Reference::FromPng(reference.MeanPng(), reference.NoisePng());
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(SamePixels(read->mean(), reference.mean()));
  EXPECT_TRUE(SamePixels(read->noise(), reference.noise()));
}

TEST(Reference, DamagedPngIsTold) {
  std::mt19937_64 random(4);
  const Reference reference =
      Reference::FromImages(ExposeSeries(EmptyCell({20, 10}), 2, 1.0, random));
  const Reference other = Reference::FromImages(ExposeSeries(EmptyCell({20, 11}), 2, 1.0, random));
  std::vector<uint8_t> grey8;
  cv::imencode(".png", cv::Mat(10, 20, CV_8UC1, cv::Scalar(3)), grey8);
  const std::string eight_bits(grey8.begin(), grey8.end());
  const std::string good = reference.MeanPng();
  EXPECT_THAT(Reference::FromPng("", good).status().message(), HasSubstr("mean is not"));
  EXPECT_THAT(Reference::FromPng(good, "nonsense").status().message(), HasSubstr("noise is not"));
  EXPECT_FALSE(Reference::FromPng(good, good.substr(0, 20)).ok());
  EXPECT_FALSE(Reference::FromPng(eight_bits, good).ok());
  EXPECT_THAT(Reference::FromPng(good, other.NoisePng()).status().message(),
              HasSubstr("differ in size"));
}

TEST(Reference, UnfitImagesAreRefused) {
  const cv::Mat image(4, 4, CV_8UC1, cv::Scalar(1));
  using Images = std::vector<cv::Mat>;
  EXPECT_THROW(Reference::FromImages(Images{}), std::invalid_argument);
  EXPECT_THROW(Reference::FromImages(Images{image}), std::invalid_argument);
  EXPECT_THROW(Reference::FromImages(Images{image, cv::Mat()}), std::invalid_argument);
  EXPECT_THROW(Reference::FromImages(Images{image, cv::Mat(4, 4, CV_8UC3, cv::Scalar(1))}),
               std::invalid_argument);
  EXPECT_THROW(Reference::FromImages(Images{image, cv::Mat(4, 5, CV_8UC1, cv::Scalar(1))}),
               std::invalid_argument);
  EXPECT_THROW(Reference::FromImages(Images{image, cv::Mat(4, 4, CV_16UC1, cv::Scalar(1))}),
               std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
