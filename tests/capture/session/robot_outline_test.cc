// SPDX-License-Identifier: Apache-2.0
// Whether an image shows the robot where its model has it.
#include "capture/session/robot_outline.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/capture/segmentation/images.h"
#include "tests/random.h"

namespace silhouette {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;

// An arm from the floor to the middle of the image, and from there to the side.
cv::Mat Arm(cv::Point by = {}) {
  cv::Mat arm = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  cv::line(arm, cv::Point(150, 190) + by, cv::Point(140, 110) + by, cv::Scalar(255), 22);
  cv::line(arm, cv::Point(140, 110) + by, cv::Point(220, 80) + by, cv::Scalar(255), 14);
  return arm;
}

Mask ArmMask() {
  const cv::Mat arm = Arm();
  return Mask::FromPredicate({kWidth, kHeight},
                             [&](int x, int y) { return arm.at<uint8_t>(y, x) != 0; });
}

// The cell with an arm that is so much brighter.
cv::Mat Shown(const cv::Mat& arm, double brighter) {
  std::mt19937_64 random{Random()()};
  cv::Mat light = EmptyCell({kWidth, kHeight});
  cv::Mat lit = light + brighter;
  lit.copyTo(light, arm);
  return Expose(light, 1, 1.5, random);
}

TEST(RobotOutline, RobotThatStandsInTheImageIsSeen) {
  for (const double brighter : {-60.0, 60.0}) {
    const auto outline = FindOutline(Shown(Arm(), brighter), ArmMask());
    ASSERT_TRUE(outline);
    EXPECT_TRUE(outline->Seen()) << outline->there << " " << outline->beside;
  }
}

TEST(RobotOutline, EmptyCellShowsNone) {
  const auto outline = FindOutline(Shown(cv::Mat::zeros(kHeight, kWidth, CV_8UC1), 60), ArmMask());
  ASSERT_TRUE(outline);
  EXPECT_FALSE(outline->Seen()) << outline->there << " " << outline->beside;
}

TEST(RobotOutline, SomethingElsewhereIsNotTheRobot) {
  for (const cv::Point by : {cv::Point(60, 0), cv::Point(-20, -25), cv::Point(0, 40)}) {
    const auto outline = FindOutline(Shown(Arm(by), 60), ArmMask());
    ASSERT_TRUE(outline);
    EXPECT_FALSE(outline->Seen()) << by << outline->there << " " << outline->beside;
  }
}

TEST(RobotOutline, ARobotBesideTheImageSaysNothing) {
  const Mask corner =
      Mask::FromPredicate({kWidth, kHeight}, [](int x, int y) { return x < 8 && y < 8; });
  EXPECT_FALSE(FindOutline(Shown(Arm(), 60), corner));
  EXPECT_FALSE(FindOutline(Shown(Arm(), 60), Mask(MaskSize{kWidth, kHeight})));
}

}  // namespace
}  // namespace silhouette
