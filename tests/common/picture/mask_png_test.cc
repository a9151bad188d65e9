// SPDX-License-Identifier: Apache-2.0
#include "common/picture/mask_png.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "common/picture/files.h"
#include "tests/random.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

std::string TempFile(const std::string& name) { return (TestFolder() / name).string(); }

TEST(Files, AFileThatCannotBeWrittenWholeStaysAsItWas) {
  const std::string path = TestFolder() / "plan.json";
  ASSERT_TRUE(WriteWholeFile(path, "the old one").ok());
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{.rlim_cur = 100, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const absl::Status status = WriteWholeFile(path, std::string(1000, 'x'));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(status.message(), HasSubstr("'" + path + "' "));
  EXPECT_EQ(*ReadWholeFile(path), "the old one");
  EXPECT_FALSE(std::filesystem::exists(path + ".new"));
  ASSERT_TRUE(WriteWholeFile(path, "the new one").ok());
  EXPECT_EQ(*ReadWholeFile(path), "the new one");
}

TEST(Files, WhoReadsAFileBehindALinkWhileItIsReplacedReadsAllOfTheOldOne) {
  const std::filesystem::path folder = TestFolder();
  const std::string link = folder / "link.json";
  const std::string path = folder / "file.json";
  ASSERT_TRUE(WriteWholeFile(path, "the old one").ok());
  std::filesystem::create_symlink("file.json", link);
  std::ifstream reader(path);
  ASSERT_TRUE(WriteWholeFile(link, "the new one").ok());
  std::string read;
  std::getline(reader, read);
  EXPECT_EQ(read, "the old one");
  EXPECT_EQ(*ReadWholeFile(path), "the new one");
  EXPECT_TRUE(std::filesystem::is_symlink(link));
}

TEST(MaskPng, RoundTripsEverySize) {
  Random random;
  for (int i = 0; i < 100; ++i) {
    const MaskSize size{1 + static_cast<int>(random() % 130), 1 + static_cast<int>(random() % 130)};
    const Mask mask = Mask::FromPredicate(size, [&](int, int) { return random() % 3 == 0; });
    const absl::StatusOr<Mask> decoded = DecodeMaskPng(EncodeMaskPng(mask), size);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(*decoded, mask);
  }
}

std::string Png(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

TEST(MaskPng, WhiteOfEveryKindOfImageIsSet) {
  const Mask expected = Mask::FromPredicate({4, 1}, [](int x, int) { return x >= 2; });
  for (const int depth : {CV_8U, CV_16U}) {
    for (const int channels : {1, 3, 4}) {
      const cv::Scalar white = cv::Scalar::all(depth == CV_8U ? 255 : 65535);
      cv::Mat image(1, 4, CV_MAKETYPE(depth, channels), cv::Scalar(0, 0, 0, white[3]));
      image.colRange(2, 4) = white;
      EXPECT_EQ(*DecodeMaskPng(Png(image)), expected) << depth << " " << channels;
    }
  }
  cv::Mat grey = MaskImage(expected);
  std::vector<uint8_t> one_bit;
  cv::imencode(".png", grey, one_bit, {cv::IMWRITE_PNG_BILEVEL, 1});
  EXPECT_EQ(*DecodeMaskPng(std::string(one_bit.begin(), one_bit.end())), expected);
}

TEST(MaskPng, OtherValuesThanBlackAndWhiteAreNoMask) {
  const auto message = [](const cv::Mat& image) {
    return std::string(DecodeMaskPng(Png(image)).status().message());
  };
  for (const int value : {1, 127, 128, 254}) {
    cv::Mat grey(2, 4, CV_8UC1, cv::Scalar(0));
    grey.at<uint8_t>(1, 3) = static_cast<uint8_t>(value);
    EXPECT_EQ(message(grey), "pixel (3, 1) is neither black (0) nor white (255) but " +
                                 std::to_string(value) + "; a mask has only these two");
  }
  EXPECT_THAT(message(cv::Mat(1, 1, CV_16UC1, cv::Scalar(1))), HasSubstr("white (65535) but 1;"));
  EXPECT_THAT(message(cv::Mat(1, 1, CV_8UC3, cv::Scalar(255, 0, 0))),
              HasSubstr("pixel (0, 0) is neither black nor white but coloured"));
  EXPECT_THAT(message(cv::Mat(1, 1, CV_8UC4, cv::Scalar(255, 255, 255, 0))),
              HasSubstr("pixel (0, 0) is transparent"));
}

TEST(MaskPng, OtherSizeIsNamedBeforeThePixels) {
  const cv::Mat grey(2, 4, CV_8UC1, cv::Scalar(127));
  EXPECT_EQ(DecodeMaskPng(Png(grey), MaskSize{2, 4}).status().message(),
            "it is 4x2 pixels large and should be 2x4");
}

TEST(MaskPng, TellsWhatIsWrongWithAFile) {
  const std::string path = TempFile("mask.png");
  ASSERT_TRUE(WriteMaskPng(path, Mask({20, 10})).ok());
  EXPECT_EQ(*ReadMaskPng(path, MaskSize{20, 10}), Mask({20, 10}));
  EXPECT_EQ(
      ReadMaskPng(path, MaskSize{10, 20}).status(),
      absl::InvalidArgumentError("'" + path + "': it is 20x10 pixels large and should be 10x20"));
  ASSERT_TRUE(WriteWholeFile(path, "no image").ok());
  EXPECT_EQ(ReadMaskPng(path).status(),
            absl::InvalidArgumentError("'" + path + "': it is not an image"));
  ASSERT_TRUE(WriteWholeFile(path, "").ok());
  EXPECT_EQ(ReadMaskPng(path).status().code(), absl::StatusCode::kInvalidArgument);
  const absl::Status missing = ReadMaskPng(path + ".none").status();
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(missing.message(), HasSubstr(path + ".none' cannot be read: No such file"));
  EXPECT_EQ(ReadMaskPng(testing::TempDir()).status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(WriteMaskPng(path + "/below/a/file.png", Mask({1, 1})).code(),
            absl::StatusCode::kNotFound);
  unlink(path.c_str());
}

TEST(MaskPng, RefusesWhatIsTooLargeForAMask) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", cv::Mat(1, 1025, CV_8UC1, cv::Scalar(0)), bytes);
  const absl::Status status = DecodeMaskPng(std::string(bytes.begin(), bytes.end())).status();
  EXPECT_THAT(status.message(), HasSubstr("1025x1 pixels large; a mask is at most 1024x1024"));
}

}  // namespace
}  // namespace silhouette
