// SPDX-License-Identifier: Apache-2.0
#include "capture/session/sentinel_sight.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "tests/random.h"

namespace silhouette {
namespace {

// A wall with a texture, moved, turned about the image's middle and with a camera's noise.
cv::Mat ImageShiftWall(double x, double y, double turn, double gain, double noise, uint64_t seed) {
  cv::RNG texture(7);
  cv::Mat wall(320, 420, CV_32FC1);
  texture.fill(wall, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(wall, wall, {}, 3);
  cv::Mat by = cv::getRotationMatrix2D({210, 160}, turn, 1);
  by.at<double>(0, 2) += x;
  by.at<double>(1, 2) += y;
  cv::Mat image;
  cv::warpAffine(wall, image, by, wall.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  image = image(cv::Rect(50, 40, 320, 240)) * gain;
  cv::RNG sensor(seed);
  cv::Mat errors(image.size(), CV_32FC1);
  sensor.fill(errors, cv::RNG::NORMAL, 0, noise);
  cv::Mat grey;
  cv::Mat(image + errors).convertTo(grey, CV_8U);
  return grey;
}

cv::Mat Everywhere() { return {240, 320, CV_8UC1, cv::Scalar(255)}; }

TEST(ImageShift, IsFoundToATenthOfAPixel) {
  Random random;
  std::uniform_real_distribution<double> far(-25, 25);
  std::uniform_real_distribution<double> near(-1.5, 1.5);
  const cv::Mat first = ImageShiftWall(0, 0, 0, 1, 1.5, random());
  for (int round = 0; round < 12; ++round) {
    auto& distance = round % 2 == 0 ? far : near;
    const double x = distance(random);
    const double y = distance(random);
    const double gain = round % 3 == 0 ? 1.15 : 1;
    const auto shift =
        ShiftBetween(first, ImageShiftWall(x, y, 0, gain, 1.5, random()), Everywhere(), gain);
    ASSERT_TRUE(shift) << x << ", " << y;
    EXPECT_NEAR(shift->x, x, 0.1);
    EXPECT_NEAR(shift->y, y, 0.1);
  }
}

TEST(ImageShift, OfAStillCameraIsNone) {
  cv::Mat now = ImageShiftWall(0, 0, 0, 1, 2, 11);
  const auto still = LargestShift(ImageShiftWall(0, 0, 0, 1, 2, 10), now, Everywhere(), 1);
  ASSERT_TRUE(still);
  EXPECT_LT(still->length(), 0.1);
  // Neither is it if somebody left a ladder in the cell.
  cv::rectangle(now, {200, 40, 30, 190}, 230, cv::FILLED);
  const auto ladder = LargestShift(ImageShiftWall(0, 0, 0, 1, 2, 10), now, Everywhere(), 1);
  ASSERT_TRUE(ladder);
  EXPECT_LT(ladder->length(), 0.3);
}

TEST(ImageShift, IsFoundBehindWhatIsNew) {
  cv::Mat now = ImageShiftWall(3, -2, 0, 1, 2, 11);
  cv::rectangle(now, {200, 40, 30, 190}, 230, cv::FILLED);
  const auto shift = ShiftBetween(ImageShiftWall(0, 0, 0, 1, 2, 10), now, Everywhere(), 1);
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->x, 3, 0.2);
  EXPECT_NEAR(shift->y, -2, 0.2);
}

TEST(ImageShift, IsOnlyLookedForInTheRegion) {
  const cv::Mat first = ImageShiftWall(0, 0, 0, 1, 1, 1);
  cv::Mat now = ImageShiftWall(0, 0, 0, 1, 1, 2);
  ImageShiftWall(4, 0, 0, 1, 1, 3)(cv::Rect(0, 0, 160, 240)).copyTo(now(cv::Rect(0, 0, 160, 240)));
  cv::Mat left = cv::Mat::zeros(240, 320, CV_8UC1);
  left(cv::Rect(0, 0, 150, 240)).setTo(255);
  cv::Mat right = cv::Mat::zeros(240, 320, CV_8UC1);
  right(cv::Rect(170, 0, 150, 240)).setTo(255);
  EXPECT_NEAR(ShiftBetween(first, now, left, 1)->x, 4, 0.15);
  EXPECT_NEAR(ShiftBetween(first, now, right, 1)->x, 0, 0.1);
}

TEST(ImageShift, OfAnEmptyWallCannotBeTold) {
  const cv::Mat wall(240, 320, CV_8UC1, cv::Scalar(90));
  EXPECT_FALSE(LargestShift(wall, wall, Everywhere(), 1));
}

TEST(ImageShift, OfACameraThatTurnedAboutItsAxisIsThatOfTheQuarters) {
  // At the middle of a quarter, 100 pixels from the image's.
  const auto shift = LargestShift(ImageShiftWall(0, 0, 0, 1, 1.5, 1),
                                  ImageShiftWall(0, 0, 2, 1, 1.5, 2), Everywhere(), 1);
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->length(), 100 * 2 * CV_PI / 180, 1);
}

}  // namespace
}  // namespace silhouette
