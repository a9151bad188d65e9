// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/image_condition.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/capture/segmentation/images.h"
#include "tests/random.h"

namespace silhouette {
namespace {

const cv::Size kConditionSize(320, 240);
constexpr double kConditionSigma = 1.5;

// Three views of a cell with walls and texture, each its own.
cv::Mat CellOfView(int view) {
  cv::Mat light(kConditionSize, CV_64FC1);
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      const int wall = y < 90 + 20 * view + x / (4 + view) ? 30 : 0;
      const int pillar = x > 60 + 80 * view && x < 90 + 80 * view ? 25 : 0;
      light.at<double>(y, x) =
          90 + wall - pillar + 4 * std::sin(0.11 * x + view) * std::sin(0.13 * y - view);
    }
  }
  cv::GaussianBlur(light, light, {}, 0.8);
  return light;
}

struct ImageConditionTest : ::testing::Test {
  Random random;
  std::mt19937_64& chance = random;
  std::vector<Outline> outlines;

  ImageConditionTest() {
    for (int view = 0; view < 3; ++view) {
      outlines.emplace_back(
          Reference::FromImages(ExposeSeries(CellOfView(view), 10, kConditionSigma, chance)));
    }
  }
  const cv::Mat nothing = cv::Mat::zeros(kConditionSize, CV_8UC1);

  ImageCondition Of(const cv::Mat& light, double gain = 1, size_t view = 0) {
    return Of(light, nothing, gain, view);
  }
  ImageCondition Of(const cv::Mat& light, const cv::Mat& foreground, double gain = 1,
                    size_t view = 0) {
    return ConditionOf(Expose(light, gain, kConditionSigma, chance), foreground, outlines, view);
  }
  // The cell moved by a shift, in pixels, and turned about its middle, in degrees.
  static cv::Mat Moved(double x, double y, double turn) {
    cv::Matx23d by = cv::getRotationMatrix2D(
        {kConditionSize.width / 2.0F, kConditionSize.height / 2.0F}, turn, 1);
    by(0, 2) += x;
    by(1, 2) += y;
    cv::Mat moved;
    cv::warpAffine(CellOfView(0), moved, by, kConditionSize, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    return moved;
  }
};

TEST_F(ImageConditionTest, CellAsItWasIsFoundAsItWas) {
  for (size_t view = 0; view < 3; ++view) {
    const ImageCondition condition = Of(CellOfView(static_cast<int>(view)), 1, view);
    EXPECT_NEAR(condition.gain, 1, 0.01);
    ASSERT_TRUE(condition.structure);
    EXPECT_GT(*condition.structure, 0.9);
    EXPECT_LT(condition.shift, 0.2);
    EXPECT_FALSE(condition.other);
  }
}

TEST_F(ImageConditionTest, LightIsMeasuredAndChangesNothingElse) {
  for (const double gain : {0.5, 0.6, 0.8, 1.3, 1.6}) {
    const ImageCondition condition = Of(CellOfView(0), gain);
    EXPECT_NEAR(condition.gain, gain, 0.02);
    EXPECT_GT(*condition.structure, 0.7) << gain;
    EXPECT_LT(condition.shift, 0.4) << gain;
  }
  EXPECT_LT(Of(CellOfView(0), 0.01).gain, 0.05);
  EXPECT_GT(Of(CellOfView(0), 5).saturated, 0.9);
}

TEST_F(ImageConditionTest, PeopleInTheImageChangeNeitherStructureNorPlace) {
  cv::Mat light = CellOfView(0);
  for (const int x : {40, 200}) light(cv::Rect(x, 60, 30, 150)) = 20.0 + x / 2;
  const ImageCondition condition = Of(light);
  EXPECT_NEAR(condition.gain, 1, 0.03);
  EXPECT_GT(*condition.structure, 0.4);
  EXPECT_LT(condition.shift, 0.5);
}

TEST_F(ImageConditionTest, WhatIsForegroundHidesNoStructure) {
  cv::Mat light = CellOfView(0);
  const cv::Rect person(0, 0, 240, 240);
  light(person) = 60.0;
  cv::Mat foreground = nothing.clone();
  foreground(person) = 255;
  EXPECT_LT(*Of(light).structure, 0.3);
  EXPECT_GT(*Of(light, foreground).structure, 0.9);
  // What hides nearly everything hides the evidence, too.
  foreground = 255;
  EXPECT_LT(*Of(light, foreground).structure, 0.3);
}

TEST_F(ImageConditionTest, SmallMotionIsMeasured) {
  for (const auto& [x, y] : {std::pair(2.0, 0.0), {0.0, -3.0}, {3.0, 3.0}, {-5.0, 1.0}}) {
    EXPECT_NEAR(Of(Moved(x, y, 0)).shift, std::hypot(x, y), 0.25 * std::hypot(x, y)) << x << y;
  }
  // The root mean square distance from the middle is 115 pixels.
  EXPECT_NEAR(Of(Moved(0, 0, 2)).shift, 115 * 2 * CV_PI / 180, 1.2);
}

TEST_F(ImageConditionTest, LargeMotionIsMotionAndNoCover) {
  EXPECT_GT(Of(Moved(14, 6, 0)).shift, 5);
}

TEST_F(ImageConditionTest, ImageOfAnotherViewIsRecognised) {
  const ImageCondition condition = Of(CellOfView(2), 1, 0);
  ASSERT_TRUE(condition.other);
  EXPECT_EQ(*condition.other, 2u);
}

TEST_F(ImageConditionTest, CoveredLensHasNoStructure) {
  for (const double level : {20.0, 90.0, 200.0}) {
    const ImageCondition condition = Of(cv::Mat(kConditionSize, CV_64FC1, cv::Scalar(level)));
    EXPECT_LT(*condition.structure, 0.1) << level;
    EXPECT_FALSE(condition.other);
  }
}

TEST_F(ImageConditionTest, PlainCellSaysNothingOfStructure) {
  const cv::Mat plain(kConditionSize, CV_64FC1, cv::Scalar(100));
  outlines[0] = Outline(Reference::FromImages(ExposeSeries(plain, 10, kConditionSigma, chance)));
  const ImageCondition condition = Of(plain, 0.5);
  EXPECT_FALSE(condition.structure);
  EXPECT_NEAR(condition.gain, 0.5, 0.02);
}

TEST_F(ImageConditionTest, ReferenceSaysWhatImagesBesideItTell) {
  EXPECT_TRUE(outlines[0].tells_structure());
  EXPECT_TRUE(outlines[0].tells_light());
  const auto outline_of = [this](double level) {
    const cv::Mat plain(kConditionSize, CV_64FC1, cv::Scalar(level));
    return Outline(Reference::FromImages(ExposeSeries(plain, 10, kConditionSigma, chance)));
  };
  EXPECT_FALSE(outline_of(100).tells_structure());
  EXPECT_TRUE(outline_of(100).tells_light());
  EXPECT_FALSE(outline_of(4).tells_light());
  EXPECT_FALSE(outline_of(255).tells_light());
}

TEST_F(ImageConditionTest, ColourImagesAndUndefinedPixelsAreTaken) {
  cv::Mat colour;
  cv::cvtColor(Expose(CellOfView(0), 1, kConditionSigma, chance), colour, cv::COLOR_GRAY2BGR);
  EXPECT_NEAR(ConditionOf(colour, nothing, outlines, 0).gain, 1, 0.02);
  const cv::Rect part(0, 0, 100, 100);
  EXPECT_THROW(ConditionOf(colour(part), nothing, outlines, 0), std::invalid_argument);
  EXPECT_THROW(ConditionOf(colour, nothing(part), outlines, 0), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
