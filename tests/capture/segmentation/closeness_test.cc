// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/difference.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/capture/segmentation/images.h"
#include "tests/random.h"

namespace silhouette {
namespace {

TEST(DifferenceOverLimit, IsAboveOneWhereAPixelDeviates) {
  Random random;
  const cv::Mat cell = EmptyCell({120, 90});
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 20, 1.5, random));
  cv::Mat light = cell.clone();
  light(cv::Rect(20, 20, 30, 30)) += 4;  // faint
  cv::rectangle(light, cv::Rect(70, 10, 20, 60), cv::Scalar(230), cv::FILLED);
  const cv::Mat image = Expose(light, 1.05, 1.5, random);
  for (const SegmentationSettings& settings :
       {SegmentationSettings{}, SegmentationSettings{.texture_difference = 0, .faint_side = 5},
        SegmentationSettings{.faint_difference = 0, .texture_difference = 0},
        SegmentationSettings{.noise_factor = 2, .min_difference = 0}}) {
    const ForegroundSteps steps = StepsToForeground(image, reference, settings);
    int close = 0;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const float over = steps.over_limit.at<float>(y, x);
        if (std::abs(over - 1) < 0.03) {
          ++close;  // what rounding leaves open
          continue;
        }
        ASSERT_EQ(steps.deviating.at<uint8_t>(y, x), over > 1 ? 255 : 0)
            << x << ", " << y << ": " << over << "\n"
            << Describe(settings);
      }
    }
    EXPECT_LT(close, image.total() / 10);
    EXPECT_GT(cv::countNonZero(steps.deviating), 500);
    EXPECT_TRUE(SamePixels(steps.foreground, Foreground(image, reference, settings)));
  }
}

TEST(ForegroundSteps, TellShadowsAndSpecksThatWereDropped) {
  const cv::Mat empty(60, 60, CV_8UC1, cv::Scalar(100));
  const Reference reference = Reference::FromImages(std::vector<cv::Mat>{empty, empty});
  cv::Mat image = empty.clone();
  image.at<uint8_t>(5, 5) = 200;
  cv::rectangle(image, cv::Rect(30, 30, 12, 12), cv::Scalar(200), cv::FILLED);
  const ForegroundSteps steps = StepsToForeground(image, reference, {});
  EXPECT_EQ(steps.deviating.at<uint8_t>(5, 5), 255);
  EXPECT_EQ(steps.no_shadow.at<uint8_t>(5, 5), 255);
  EXPECT_EQ(steps.foreground.at<uint8_t>(5, 5), 0);
  EXPECT_EQ(steps.foreground.at<uint8_t>(35, 35), 255);
}

}  // namespace
}  // namespace silhouette
