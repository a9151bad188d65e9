// SPDX-License-Identifier: Apache-2.0
#include "common/picture/camera_image.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>

#include "common/picture/image_file.h"

namespace silhouette {
namespace {

// With their lengths, as they contain zeros.
constexpr std::string_view kPngStart("\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR", 16);
constexpr std::string_view kPngEnd("\0\0\0\0IEND\xae\x42\x60\x82", 12);
constexpr std::string_view kJpegStart("\xff\xd8\xff");
constexpr std::string_view kJpegEnd("\xff\xd9");

// A big-endian number of `count` bytes; `at + count` is within `bytes`.
uint32_t NumberAt(std::string_view bytes, size_t at, size_t count) {
  uint32_t number = 0;
  for (size_t i = 0; i < count; ++i) number = number << 8 | static_cast<uint8_t>(bytes[at + i]);
  return number;
}

// PNG.

constexpr size_t kPngHeader = 33;  // its signature and first chunk

std::optional<cv::Size> PngSize(std::string_view bytes) {
  if (bytes.size() < kPngHeader + kPngEnd.size() || !bytes.ends_with(kPngEnd)) return std::nullopt;
  return cv::Size(static_cast<int>(NumberAt(bytes, kPngStart.size(), 4)),
                  static_cast<int>(NumberAt(bytes, kPngStart.size() + 4, 4)));
}

// How many bytes the rows of an image are before they are compressed, each after a byte of its own.
uint64_t BytesOfRows(std::string_view png) {
  constexpr std::array<uint64_t, 7> kChannels = {1, 0, 3, 1, 2, 0, 4};  // by the type of colour
  const auto at = [&](size_t place) { return uint64_t{static_cast<uint8_t>(png[place])}; };
  const uint64_t bits = at(24) * (at(25) < kChannels.size() ? kChannels[at(25)] : 0);
  const auto rows = [&](uint64_t first_x, uint64_t step_x, uint64_t first_y, uint64_t step_y) {
    const uint64_t width = (NumberAt(png, 16, 4) + step_x - 1 - first_x) / step_x;
    const uint64_t height = (NumberAt(png, 20, 4) + step_y - 1 - first_y) / step_y;
    return width == 0 ? 0 : height * (1 + (width * bits + 7) / 8);
  };
  if (at(28) == 0) return rows(0, 1, 0, 1);
  return rows(0, 8, 0, 8) + rows(4, 8, 0, 8) + rows(0, 4, 4, 8) + rows(2, 4, 0, 4) +
         rows(0, 2, 2, 4) + rows(1, 2, 0, 2) + rows(0, 1, 1, 2);
}

// Whether the compressed data of an image are its rows and nothing more. (What is missing is an
// error of the decoder.)
bool HasNoMoreThanItsRows(std::string_view png) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return false;
  const uint64_t expected = BytesOfRows(png);
  std::array<uint8_t, 32768> rows{};
  int state = Z_OK;
  for (size_t at = kPngHeader; at + 12 <= png.size();) {
    const size_t length = NumberAt(png, at, 4);
    if (length > png.size() - at - 12) break;
    if (png.substr(at + 4, 4) == "IDAT") {
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(png.data() + at + 8));
      stream.avail_in = static_cast<uInt>(length);
      while (state == Z_OK && (stream.avail_in > 0 || stream.avail_out == 0)) {
        stream.next_out = rows.data();
        stream.avail_out = rows.size();
        state = inflate(&stream, Z_NO_FLUSH);
        if (stream.total_out > expected) state = Z_DATA_ERROR;
      }
      if (stream.avail_in > 0) state = Z_DATA_ERROR;
    }
    at += 12 + length;
  }
  const bool whole = state == Z_STREAM_END && stream.total_out == expected;
  inflateEnd(&stream);
  return whole;
}

// JPEG.

// Whether a marker starts a frame: SOF0 to SOF15 without DHT, JPG and DAC.
bool StartsFrame(uint8_t marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::optional<cv::Size> JpegSize(std::string_view bytes) {
  // Some cameras pad their images with zeros.
  while (bytes.ends_with('\0')) bytes.remove_suffix(1);
  if (!bytes.ends_with(kJpegEnd)) return std::nullopt;
  size_t at = 2;
  while (at + 9 <= bytes.size() && bytes[at] == '\xff') {
    const auto marker = static_cast<uint8_t>(bytes[at + 1]);
    if (marker == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    if (StartsFrame(marker)) {
      return cv::Size(static_cast<int>(NumberAt(bytes, at + 7, 2)),
                      static_cast<int>(NumberAt(bytes, at + 5, 2)));
    }
    at += 2 + NumberAt(bytes, at + 2, 2);
  }
  return std::nullopt;
}

}  // namespace

std::optional<cv::Size> SizeOfCameraImage(std::string_view bytes) {
  if (bytes.starts_with(kPngStart)) return PngSize(bytes);
  if (bytes.starts_with(kJpegStart)) return JpegSize(bytes);
  return std::nullopt;
}

std::optional<cv::Mat> DecodeCameraImage(std::string_view bytes) {
  const std::optional<cv::Size> size = SizeOfCameraImage(bytes);
  if (!size || size->empty() || cv::Size2d(*size).area() > kMostImagePixels) return std::nullopt;
  if (bytes.starts_with(kPngStart) && !HasNoMoreThanItsRows(bytes)) return std::nullopt;
  cv::Mat image = ImageOfBytes(bytes, cv::IMREAD_ANYCOLOR);
  return image.size() == *size ? std::optional(image) : std::nullopt;
}

}  // namespace silhouette
