// SPDX-License-Identifier: Apache-2.0
#include "common/picture/camera_image.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

namespace silhouette {
namespace {

std::string BigEndian(uint32_t number) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(number >> shift);
  return bytes;
}

std::string Chunk(const std::string& name, const std::string& data) {
  const std::string body = name + data;
  const auto* bytes = reinterpret_cast<const Bytef*>(body.data());
  const uLong checksum = crc32(0, bytes, static_cast<uInt>(body.size()));
  return BigEndian(static_cast<uint32_t>(data.size())) + body +
         BigEndian(static_cast<uint32_t>(checksum));
}

// A PNG image, 3 pixels wide and 2 high, of one byte a pixel, with these bytes as its rows.
std::string PngWithRows(const std::string& rows, const std::string& after = "", int height = 2) {
  std::string data(compressBound(rows.size()), '\0');
  uLongf length = data.size();
  compress(reinterpret_cast<Bytef*>(data.data()), &length,
           reinterpret_cast<const Bytef*>(rows.data()), rows.size());
  data.resize(length);
  return "\x89PNG\r\n\x1a\n" +
         Chunk("IHDR", BigEndian(3) + BigEndian(static_cast<uint32_t>(height)) +
                           std::string("\x08\0\0\0\0", 5)) +
         Chunk("IDAT", data + after) + Chunk("IEND", "");
}

const std::string kRow("\0abc", 4);  // not filtered

TEST(CameraImage, IsReadAsItIs) {
  const auto image = DecodeCameraImage(PngWithRows(kRow + kRow));
  ASSERT_TRUE(image);
  EXPECT_EQ(image->size(), cv::Size(3, 2));
  EXPECT_EQ(image->type(), CV_8UC1);
  EXPECT_EQ(image->at<uint8_t>(1, 2), 'c');
}

TEST(CameraImage, OfAnyColourAndOrderOfRowsIsRead) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1}) {
    for (const bool jpeg : {false, true}) {
      if (jpeg && type != CV_8UC1 && type != CV_8UC3) continue;
      const cv::Mat image(13, 9, type, cv::Scalar::all(90));
      std::vector<uint8_t> bytes;
      cv::imencode(jpeg ? ".jpg" : ".png", image, bytes);
      const std::string_view file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      EXPECT_EQ(SizeOfCameraImage(file), cv::Size(9, 13));
      const auto read = DecodeCameraImage(file);
      ASSERT_TRUE(read) << type << jpeg;
      const cv::Mat expected = cv::imdecode(bytes, cv::IMREAD_ANYCOLOR);
      EXPECT_EQ(read->type(), expected.type());
      EXPECT_EQ(cv::norm(*read, expected, cv::NORM_INF), 0) << type << jpeg;
    }
  }
  // An interlaced one: of 3x1 pixels, in three passes of one row each.
  std::string interlaced = PngWithRows(std::string("\0a\0c\0b", 6), "", 1);
  interlaced[28] = 1;
  interlaced.replace(8, 25, Chunk("IHDR", interlaced.substr(16, 13)));
  const auto read = DecodeCameraImage(interlaced);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->at<uint8_t>(0, 1), 'b');
}

TEST(CameraImage, WithMoreOrFewerRowsThanItSaysIsNone) {
  EXPECT_FALSE(DecodeCameraImage(PngWithRows(kRow + kRow + kRow)));
  EXPECT_FALSE(DecodeCameraImage(PngWithRows(kRow + kRow + "x")));
  EXPECT_FALSE(DecodeCameraImage(PngWithRows(kRow + kRow, "x")));
  EXPECT_FALSE(DecodeCameraImage(PngWithRows(kRow)));
}

TEST(CameraImage, ThatSaysThatItIsImmenseIsNone) {
  EXPECT_FALSE(DecodeCameraImage(PngWithRows(kRow + kRow, "", 1 << 30)));
  EXPECT_FALSE(DecodeCameraImage(PngWithRows(kRow + kRow, "", -1)));
}

TEST(CameraImage, CutAnywhereIsNone) {
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", cv::Mat(40, 40, CV_8UC1, cv::Scalar(90)), bytes);
  const std::string jpeg(bytes.begin(), bytes.end());
  const std::string png = PngWithRows(kRow + kRow);
  for (const auto& [whole, end] :
       {std::pair(jpeg, jpeg.substr(jpeg.size() - 2)), {png, png.substr(png.size() - 12)}}) {
    ASSERT_TRUE(DecodeCameraImage(whole));
    for (size_t length = 0; length < whole.size() - end.size(); ++length) {
      EXPECT_FALSE(DecodeCameraImage(whole.substr(0, length) + end)) << length;
    }
  }
}

}  // namespace
}  // namespace silhouette
