// SPDX-License-Identifier: Apache-2.0
#include "common/picture/image_file.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace silhouette {
namespace {

std::string RampAs(const std::string& extension) {
  cv::Mat ramp(48, 64, CV_8UC3);
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) ramp.at<cv::Vec3b>(y, x) = cv::Vec3b(4 * x, 5 * y, x * y);
  }
  std::vector<uint8_t> bytes;
  cv::imencode(extension, ramp, bytes);
  return {bytes.begin(), bytes.end()};
}

std::string PngOfRamp() { return RampAs(".png"); }

cv::Mat AsOpenCvReads(const std::string& bytes, int flags) {
  return cv::imdecode(std::vector<uint8_t>(bytes.begin(), bytes.end()), flags);
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

TEST(ImageFile, JpegIsDecodedInTheChannelsThatAreAskedFor) {
  const std::string jpeg = RampAs(".jpg");
  for (const int flags : {cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH, int{cv::IMREAD_COLOR},
                          int{cv::IMREAD_ANYCOLOR}, int{cv::IMREAD_UNCHANGED}}) {
    const cv::Mat image = ImageOfBytes(jpeg, flags);
    const cv::Mat expected = AsOpenCvReads(jpeg, flags);
    ASSERT_EQ(image.type(), expected.type()) << flags;
    EXPECT_EQ(cv::norm(image, expected, cv::NORM_INF), 0) << flags;
  }
}

TEST(ImageFile, JpegThatIsCutAnywhereIsNoImageAndNothingIsWrittenToStderr) {
  const std::string jpeg = RampAs(".jpg");
  testing::internal::CaptureStderr();
  for (size_t size = 0; size < jpeg.size(); ++size) {
    EXPECT_TRUE(ImageOfBytes(jpeg.substr(0, size), cv::IMREAD_COLOR).empty()) << size;
  }
  EXPECT_FALSE(ImageOfBytes(jpeg + "what a camera adds", cv::IMREAD_COLOR).empty());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(ImageFile, JpegIsNotTurnedThoughItSaysHowTheCameraWasHeld) {
  std::string jpeg = RampAs(".jpg");
  // Exif with the orientation 6, a quarter of a turn.
  jpeg.insert(2, std::string("\xff\xe1\0\x22"
                             "Exif\0\0II*\0\x8\0\0\0\x1\0\x12\x1\x3\0\x1\0\0\0\x6\0\0\0\0\0\0\0",
                             36));
  EXPECT_EQ(AsOpenCvReads(jpeg, cv::IMREAD_COLOR).size(), cv::Size(48, 64));
  EXPECT_EQ(ImageOfBytes(jpeg, cv::IMREAD_COLOR).size(), cv::Size(64, 48));
}

TEST(ImageFile, SixteenBitsOfWhichFewAreUsedAreRefused) {
  const auto check = [](int type, double brightest) {
    cv::Mat image(4, 6, type, cv::Scalar::all(0));
    image.col(2) = cv::Scalar::all(brightest);
    std::vector<uint8_t> png;
    cv::imencode(".png", image, png);
    const std::string bytes(png.begin(), png.end());
    return CheckUsedBits("top.png", bytes, ImageOfBytes(bytes, cv::IMREAD_ANYCOLOR));
  };
  EXPECT_EQ(check(CV_16UC1, 4095).message(),
            "top.png uses the lower 12 of its 16 bits, of which the upper 8 are read; light the "
            "view if it is dark, or convert all its images to 8 bits, by the same factor");
  EXPECT_TRUE(absl::IsInvalidArgument(check(CV_16UC3, 1023)));
  for (const double brightest : {0, 4096, 65535, 5 << 4}) {  // the last one: the upper 12 bits
    EXPECT_EQ(check(CV_16UC1, brightest), absl::OkStatus()) << brightest;
  }
  EXPECT_EQ(check(CV_8UC1, 3), absl::OkStatus());
}

}  // namespace
}  // namespace silhouette
