// SPDX-License-Identifier: Apache-2.0
// Video files and folders of images as cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

cv::Mat Grey(int level) { return {24, 32, CV_8UC1, cv::Scalar(level)}; }

absl::StatusOr<CameraImage> RecordedCameraTake(CameraSource& source) {
  if (absl::Status status = source.Trigger(); !status.ok()) return status;
  auto images = source.Wait(RunningNow() + source.timeout());
  if (!images.ok()) return images.status();
  EXPECT_EQ(images->size(), 1u);
  return std::move(images->front());
}

class FolderCamera : public testing::Test {
 protected:
  FolderCamera() {
    cv::imwrite(folder_ + "/2.png", Grey(20));
    cv::imwrite(folder_ + "/1.png", Grey(10));
  }

  const std::string folder_ = FreshFolder().string();
};

TEST_F(FolderCamera, GivesItsImagesInTheOrderOfTheirNames) {
  std::ofstream(folder_ + "/notes.txt") << "no image";
  const auto camera = OpenFolder("top", {.folder = folder_});
  ASSERT_TRUE(camera.ok()) << camera.status();
  const absl::Time before = absl::Now();
  const auto first = RecordedCameraTake(**camera);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->width, 32);
  EXPECT_EQ(first->height, 24);
  EXPECT_EQ(first->channels, 1);
  EXPECT_EQ(first->pixels, std::vector<uint8_t>(32 * 24, 10));
  EXPECT_GE(first->captured, before) << "the time at which it was asked for";
  EXPECT_EQ(RecordedCameraTake(**camera)->pixels[0], 20);
}

TEST_F(FolderCamera, EndIsToldOrTheFirstComesAgain) {
  const auto once = OpenFolder("top", {.folder = folder_});
  const auto endless = OpenFolder("top", {.folder = folder_, .repeat = true});
  for (const int level : {10, 20}) {
    EXPECT_EQ(RecordedCameraTake(**once)->pixels[0], level);
    EXPECT_EQ(RecordedCameraTake(**endless)->pixels[0], level);
  }
  const absl::Status status = RecordedCameraTake(**once).status();
  EXPECT_TRUE(absl::IsOutOfRange(status));
  EXPECT_THAT(status.message(), HasSubstr("no more images; 'repeat: true'"));
  EXPECT_EQ(RecordedCameraTake(**endless)->pixels[0], 10);
}

TEST_F(FolderCamera, FoldersWithoutImagesAreTold) {
  EXPECT_TRUE(absl::IsNotFound(OpenFolder("top", {.folder = folder_ + "/none"}).status()));
  std::filesystem::create_directories(folder_ + "/empty");
  EXPECT_TRUE(absl::IsInvalidArgument(OpenFolder("top", {.folder = folder_ + "/empty"}).status()));
}

TEST_F(FolderCamera, DamagedImageIsToldInItsTurnAndTheOthersKeepTheirs) {
  for (const int bytes : {40, 4, 0}) {
    std::filesystem::resize_file(folder_ + "/1.png", bytes);
    const auto camera = OpenFolder("top", {.folder = folder_});
    ASSERT_TRUE(camera.ok()) << camera.status();
    EXPECT_THAT(RecordedCameraTake(**camera).status().message(),
                HasSubstr("1.png is not an image"));
    EXPECT_EQ(RecordedCameraTake(**camera)->pixels[0], 20);
  }
}

TEST(VideoCamera, GivesEveryImageOnce) {
  const std::string file = (FreshFolder() / "video.avi").string();
  {
    cv::VideoWriter writer(file, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10, cv::Size(64, 48));
    ASSERT_TRUE(writer.isOpened());
    for (const int level : {40, 120, 200}) {
      writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(level)));
    }
  }
  const auto camera = OpenVideo("top", {.file = file});
  ASSERT_TRUE(camera.ok()) << camera.status();
  for (const int level : {40, 120, 200}) {
    const auto image = RecordedCameraTake(**camera);
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->channels, 3);
    EXPECT_NEAR(image->pixels[0], level, 4);
  }
  EXPECT_TRUE(absl::IsOutOfRange(RecordedCameraTake(**camera).status()));
}

TEST(VideoCamera, FilesThatAreNoVideosAreTold) {
  const std::string file = (FreshFolder() / "letter.avi").string();
  std::ofstream(file) << "dear reader";
  EXPECT_TRUE(absl::IsInvalidArgument(OpenVideo("top", {.file = file}).status()));
  EXPECT_TRUE(absl::IsNotFound(OpenVideo("top", {.file = file + ".none"}).status()));
}

TEST(StreamCamera, DeviceThatIsNotThereIsTold) {
  V4l2Source source;
  source.device = "/dev/no_video";
  const absl::Status status = OpenV4l2Camera("top", 640, 480, source).status();
  EXPECT_TRUE(absl::IsNotFound(status));
  EXPECT_THAT(status.message(), HasSubstr("there is no device /dev/no_video"));
}

}  // namespace
}  // namespace silhouette
