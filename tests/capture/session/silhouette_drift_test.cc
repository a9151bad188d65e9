// SPDX-License-Identifier: Apache-2.0
#include "capture/session/silhouette_drift.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "capture/segmentation/difference.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

constexpr int kScale = 16;  // images are drawn so much larger, to shift by parts of pixels
const ViewSizes kSizes{.image = {320, 240}, .mask = {64, 64}};

// An arm of two links before a grey room. The image is turned about the arm's middle by `turn`
// radians, clockwise, and shifted by (dx, dy) pixels.
cv::Mat Image(double dx, double dy, bool robot, uint64_t seed, double turn = 0) {
  cv::Mat large(240 * kScale, 320 * kScale, CV_8U, cv::Scalar(90));
  const Eigen::Vector2d middle(180, 140);
  const auto at = [&](double x, double y) {
    const Eigen::Vector2d moved = middle + Eigen::Vector2d(dx, dy) +
                                  Eigen::Rotation2Dd(turn) * (Eigen::Vector2d(x, y) - middle);
    return cv::Point(static_cast<int>(moved.x() * kScale), static_cast<int>(moved.y() * kScale));
  };
  if (robot) {
    cv::line(large, at(150, 239), at(170, 120), cv::Scalar(200), 26 * kScale);
    cv::line(large, at(170, 120), at(240, 90), cv::Scalar(200), 18 * kScale);
  }
  cv::Mat image;
  cv::resize(large, image, {320, 240}, 0, 0, cv::INTER_AREA);
  cv::Mat noise(image.size(), CV_16S);
  cv::RNG random(seed);
  random.fill(noise, cv::RNG::NORMAL, 0, 1.5);
  cv::Mat noisy;
  image.convertTo(noisy, CV_16S);
  noisy += noise;
  noisy.convertTo(image, CV_8U);
  return image;
}

class SilhouetteDrift : public testing::Test {
 protected:
  static Reference EmptyCell() {
    std::vector<cv::Mat> images;
    for (uint64_t i = 0; i < 8; ++i) images.push_back(Image(0, 0, false, 100 + i));
    return Reference::FromImages(images);
  }
  ViewDrift Drift(const cv::Mat& image) const {
    return DriftBySilhouette("top", kSizes, image, reference_, settings_, robot_);
  }

  const Reference reference_ = EmptyCell();
  const SegmentationSettings settings_{};
  const Mask robot_ = Difference(Image(0, 0, true, 1), reference_, settings_, {64, 64});
};

TEST_F(SilhouetteDrift, ShiftsAreMeasuredToAFractionOfAMaskPixel) {
  // A mask pixel is 5 x 3.75 pixels.
  for (const auto& [dx, dy] : {std::pair{0.0, 0.0}, {2.5, 0.0}, {-6.0, 1.5}, {9.0, -7.0}}) {
    const ViewDrift drift = Drift(Image(dx, dy, true, 2));
    ASSERT_TRUE(drift.checked) << drift.message;
    EXPECT_NEAR(drift.shift.x(), dx, 1) << dx << ", " << dy;
    EXPECT_NEAR(drift.shift.y(), dy, 1) << dx << ", " << dy;
    EXPECT_NEAR(drift.moved_mask, std::hypot(dx / 5, dy / 3.75), 0.2);
  }
}

TEST_F(SilhouetteDrift, ACameraThatStandsStillHoldsWhateverTheNoise) {
  for (uint64_t seed = 10; seed < 20; ++seed) {
    const ViewDrift drift = Drift(Image(0, 0, true, seed));
    ASSERT_TRUE(drift.checked) << drift.message;
    EXPECT_LT(drift.moved_mask, 0.2);
  }
}

TEST_F(SilhouetteDrift, ATurnAboutTheRobotIsMeasuredAtTheImagesCorners) {
  for (const double degrees : {1.5, -1.5, 3.0}) {
    const double turn = degrees * std::numbers::pi / 180;
    const ViewDrift drift = Drift(Image(0, 0, true, 2, turn));
    ASSERT_TRUE(drift.checked) << drift.message;
    EXPECT_NEAR(drift.turn, turn, std::abs(turn) / 2);
    // A corner is 56 mask pixels away, as the turn moves it.
    EXPECT_NEAR(drift.moved_mask, 56 * std::abs(turn), 28 * std::abs(turn));
    EXPECT_GT(drift.moved, 3);
  }
}

TEST_F(SilhouetteDrift, ACompactOutlineLeavesATurnOpen) {
  cv::Mat image = Image(0, 0, false, 2);
  cv::circle(image, {160, 120}, 25, cv::Scalar(200), cv::FILLED);
  const Mask disc = Difference(image, reference_, settings_, {64, 64});
  const ViewDrift drift = DriftBySilhouette("top", kSizes, image, reference_, settings_, disc);
  EXPECT_FALSE(drift.checked);
  EXPECT_THAT(drift.message, HasSubstr("use tags"));
}

TEST_F(SilhouetteDrift, ARobotThatIsNotThereIsNotChecked) {
  const ViewDrift drift = Drift(Image(0, 0, false, 2));
  EXPECT_FALSE(drift.checked);
  EXPECT_THAT(drift.message, HasSubstr("does not show the robot as it was captured"));
}

TEST_F(SilhouetteDrift, AViewThatHardlySeesTheRobotIsNotChecked) {
  const ViewDrift drift = DriftBySilhouette("top", kSizes, Image(0, 0, true, 2), reference_,
                                            settings_, Mask(MaskSize{64, 64}));
  EXPECT_FALSE(drift.checked);
  EXPECT_THAT(drift.message, HasSubstr("hardly seen"));
}

TEST_F(SilhouetteDrift, AnOutlineAlongOneDirectionLeavesTheShiftOpen) {
  // A beam right across the image.
  cv::Mat image = Image(0, 0, false, 2);
  cv::rectangle(image, {0, 100}, {319, 130}, cv::Scalar(200), cv::FILLED);
  const Mask beam = Difference(image, reference_, settings_, {64, 64});
  const ViewDrift drift = DriftBySilhouette("top", kSizes, image, reference_, settings_, beam);
  EXPECT_FALSE(drift.checked);
  EXPECT_THAT(drift.message, HasSubstr("leaves open"));
}

}  // namespace
}  // namespace silhouette
