// SPDX-License-Identifier: Apache-2.0
// Video files and folders of images as cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "absl/strings/str_cat.h"
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

cv::Mat MatOf(const CameraImage& image) {
  // It is only read.
  auto* pixels = const_cast<uint8_t*>(image.pixels.data());
  return {image.height, image.width, CV_8UC(image.channels), pixels};
}

// Images that take many bytes in any coding.
cv::Mat Noise(int seed) {
  cv::Mat image(48, 64, CV_8UC3);
  cv::RNG random(static_cast<uint64_t>(seed) + 1);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

void WriteVideo(const std::string& file, const char* codec, int images) {
  const int fourcc = cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]);
  cv::VideoWriter writer(file, fourcc, 25, cv::Size(64, 48));
  ASSERT_TRUE(writer.isOpened());
  cv::Mat image = Noise(0);
  for (int i = 0; i < images; ++i) {
    image(cv::Rect(i, 16, 16, 16)).setTo(cv::Scalar(0, 0, 255));
    writer.write(image);
  }
}

void WriteBytes(const std::string& file, const std::vector<std::vector<uint8_t>>& parts) {
  std::ofstream out(file, std::ios::binary);
  for (const std::vector<uint8_t>& part : parts) {
    out.write(reinterpret_cast<const char*>(part.data()),
              static_cast<std::streamsize>(part.size()));
  }
}

// Where the images' bytes begin.
std::vector<size_t> PacketsOfAvi(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string all(std::istreambuf_iterator<char>(in), {});
  std::vector<size_t> packets;
  const size_t index = all.find("idx1");
  for (size_t at = all.find("00dc", all.find("movi")); at < index; at = all.find("00dc", at + 4)) {
    packets.push_back(at + 8);
  }
  return packets;
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

TEST_F(FolderCamera, JpegThatIsCutOffIsToldInItsTurnAndTheOthersKeepTheirs) {
  std::filesystem::remove(folder_ + "/1.png");
  std::vector<uint8_t> whole;
  cv::imencode(".jpg", Noise(1), whole);
  const size_t size = whole.size();
  for (const size_t kept : {size, size - 1, size - 2, size / 2, size_t{200}}) {
    for (const bool zeros : {false, true}) {  // in place of the rest
      SCOPED_TRACE(absl::StrCat(kept, " of ", size, zeros));
      std::vector<uint8_t> bytes = whole;
      bytes.resize(kept);
      if (zeros) bytes.resize(size);
      WriteBytes(folder_ + "/1.jpg", {bytes});
      const auto camera = OpenFolder("top", {.folder = folder_});
      ASSERT_TRUE(camera.ok()) << camera.status();
      const auto image = RecordedCameraTake(**camera);
      EXPECT_EQ(image.ok(), kept == size);
      if (!image.ok()) {
        EXPECT_THAT(image.status().message(),
                    HasSubstr("1.jpg is not an image that can be read, or is cut off"));
      }
      EXPECT_EQ(RecordedCameraTake(**camera)->pixels[0], 20);
    }
  }
}

TEST_F(FolderCamera, SixteenBitImageIsReadInItsUpperEightAndRefusedIfTheseAreBlack) {
  cv::imwrite(folder_ + "/1.png", cv::Mat(24, 32, CV_16UC1, cv::Scalar(4095)));
  cv::imwrite(folder_ + "/2.png", cv::Mat(24, 32, CV_16UC1, cv::Scalar(200 * 256 + 255)));
  const auto camera = OpenFolder("top", {.folder = folder_});
  const absl::Status refused = RecordedCameraTake(**camera).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused));
  EXPECT_THAT(refused.message(), HasSubstr("/1.png uses the lower 12 of its 16 bits"));
  EXPECT_EQ(RecordedCameraTake(**camera)->pixels[0], 200);
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

TEST(VideoCamera, ImagesHaveTheirOwnSizeAlsoWhereItChanges) {
  const std::string file = (FreshFolder() / "sizes.mjpeg").string();
  const std::vector<cv::Size> sizes = {{64, 48}, {96, 48}, {32, 24}, {64, 48}};
  std::vector<std::vector<uint8_t>> images;
  for (size_t i = 0; i < sizes.size(); ++i) {
    const cv::Mat image(sizes[i], CV_8UC3, cv::Scalar::all(40 + 50. * static_cast<double>(i)));
    cv::imencode(".jpg", image, images.emplace_back());
  }
  WriteBytes(file, images);
  const auto camera = OpenVideo("top", {.file = file});
  ASSERT_TRUE(camera.ok()) << camera.status();
  for (size_t i = 0; i < sizes.size(); ++i) {
    SCOPED_TRACE(i);
    const auto image = RecordedCameraTake(**camera);
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(cv::Size(image->width, image->height), sizes[i]);
    for (const uint8_t pixel : image->pixels) ASSERT_NEAR(pixel, 40 + 50 * i, 4);
  }
}

TEST(VideoCamera, ImagesThatTheDecoderHoldsBackComeAtTheEnd) {
  const std::string file = (FreshFolder() / "video.avi").string();
  WriteVideo(file, "mpg2", 30);  // coded from images before and after
  const auto once = OpenVideo("top", {.file = file});
  const auto endless = OpenVideo("top", {.file = file, .repeat = true});
  ASSERT_TRUE(once.ok()) << once.status();
  for (int i = 0; i < 30; ++i) {
    SCOPED_TRACE(i);
    const auto image = RecordedCameraTake(**once);
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->pixels, RecordedCameraTake(**endless)->pixels);
  }
  EXPECT_TRUE(absl::IsOutOfRange(RecordedCameraTake(**once).status()));
  EXPECT_TRUE(RecordedCameraTake(**endless).ok());
}

TEST(VideoCamera, DamagedJpegIsToldInItsTurnAndTheOthersKeepTheirs) {
  const std::string file = (FreshFolder() / "damaged.mjpeg").string();
  std::vector<std::vector<uint8_t>> images(4);
  for (size_t i = 0; i < images.size(); ++i)
    cv::imencode(".jpg", Noise(static_cast<int>(i)), images[i]);
  for (const size_t i : {0u, 2u}) images[i].resize(images[i].size() * 2 / 3);
  WriteBytes(file, images);
  const auto camera = OpenVideo("top", {.file = file});
  ASSERT_TRUE(camera.ok()) << camera.status();
  for (int i = 1; i <= 4; ++i) {
    const auto image = RecordedCameraTake(**camera);
    EXPECT_EQ(image.ok(), i % 2 == 0) << image.status();
    if (image.ok()) continue;
    EXPECT_THAT(image.status().message(),
                HasSubstr(absl::StrCat("image ", i, " of ", file, " is damaged")));
  }
  EXPECT_TRUE(absl::IsOutOfRange(RecordedCameraTake(**camera).status()));
}

TEST(VideoCamera, ImagesThatRestOnADamagedOneAreDamagedUntilTheNextKeyImage) {
  const std::string file = (FreshFolder() / "damaged.avi").string();
  WriteVideo(file, "FMP4", 40);  // a key image is every twelfth
  const std::vector<size_t> packets = PacketsOfAvi(file);
  ASSERT_EQ(packets.size(), 40u);
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(static_cast<std::streamoff>(packets[15] + 20));
    bytes << std::string(8, 'x');
  }
  const auto camera = OpenVideo("top", {.file = file});
  ASSERT_TRUE(camera.ok()) << camera.status();
  for (int i = 0; i < 40; ++i) {
    const auto image = RecordedCameraTake(**camera);
    EXPECT_EQ(image.ok(), i < 15 || i >= 24) << i << " " << image.status();
  }
}

TEST(VideoCamera, ImagesOfALossyTransportAreWholeOrDamaged) {
  const std::string file = (FreshFolder() / "video.ts").string();
  WriteVideo(file, "mpg2", 40);
  const auto read = [&file] {
    std::vector<std::vector<uint8_t>> images;  // empty: damaged
    const auto camera = OpenVideo("top", {.file = file});
    EXPECT_TRUE(camera.ok()) << camera.status();
    for (;;) {
      auto image = RecordedCameraTake(**camera);
      if (absl::IsOutOfRange(image.status())) return images;
      images.push_back(image.ok() ? std::move(image->pixels) : std::vector<uint8_t>());
    }
  };
  const auto whole = read();
  ASSERT_EQ(whole.size(), 40u);
  std::ifstream in(file, std::ios::binary);
  const std::string sent(std::istreambuf_iterator<char>(in), {});
  constexpr size_t kPacket = 188;
  for (const size_t share : {30u, 40u, 50u}) {
    SCOPED_TRACE(share);
    std::string lossy = sent;
    lossy.erase(sent.size() / kPacket * share / 100 * kPacket, kPacket);
    std::ofstream(file, std::ios::binary) << lossy;
    const auto left = read();
    EXPECT_THAT(left, testing::Contains(testing::IsEmpty()));
    EXPECT_EQ(left.back(), whole.back());
    for (const auto& image : left) {
      EXPECT_TRUE(image.empty() || std::find(whole.begin(), whole.end(), image) != whole.end());
    }
  }
}

TEST(VideoCamera, TurnsImagesAsTheFileSays) {
  const std::string file = (FreshFolder() / "turned.mp4").string();
  WriteVideo(file, "mp4v", 3);
  const auto upright = OpenVideo("top", {.file = file});
  const auto first = RecordedCameraTake(**upright);
  ASSERT_TRUE(first.ok()) << first.status();
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    const std::string all(std::istreambuf_iterator<char>(bytes), {});
    const size_t track = all.find("tkhd");
    ASSERT_NE(track, std::string::npos);
    // Its matrix: by half a turn.
    for (const size_t at : {track + 44, track + 60}) {
      bytes.seekp(static_cast<std::streamoff>(at));
      bytes.write("\xff\xff\0\0", 4);
    }
  }
  const auto turned = RecordedCameraTake(**OpenVideo("top", {.file = file}));
  ASSERT_TRUE(turned.ok()) << turned.status();
  cv::Mat expected = MatOf(*first).clone();
  cv::rotate(expected, expected, cv::ROTATE_180);
  EXPECT_EQ(cv::norm(MatOf(*turned), expected, cv::NORM_INF), 0);
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
