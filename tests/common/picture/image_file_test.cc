// SPDX-License-Identifier: Apache-2.0
#include "common/picture/image_file.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace silhouette {
namespace {

std::string PngOfRamp() {
  cv::Mat ramp(48, 64, CV_8UC3);
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) ramp.at<cv::Vec3b>(y, x) = cv::Vec3b(4 * x, 5 * y, x * y);
  }
  std::vector<uint8_t> png;
  cv::imencode(".png", ramp, png);
  return {png.begin(), png.end()};
}

TEST(ImageFile, WholePngIsDecoded) {
  const cv::Mat image = ImageOfBytes(PngOfRamp(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(image.size(), cv::Size(64, 48));
  EXPECT_EQ(image.at<cv::Vec3b>(3, 5), cv::Vec3b(20, 15, 15));
}

TEST(ImageFile, CutOrDamagedPngIsNoImageAndNothingIsWrittenToStderr) {
  const std::string png = PngOfRamp();
  testing::internal::CaptureStderr();
  for (size_t size = 0; size < png.size(); size += 7) {
    EXPECT_TRUE(ImageOfBytes(png.substr(0, size), cv::IMREAD_UNCHANGED).empty()) << size;
  }
  for (size_t at = 8; at < png.size(); at += 5) {
    std::string damaged = png;
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    EXPECT_TRUE(ImageOfBytes(damaged, cv::IMREAD_UNCHANGED).empty()) << at;
  }
  EXPECT_TRUE(ImageOfFile("no/such/file.png", cv::IMREAD_UNCHANGED).empty());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace silhouette
