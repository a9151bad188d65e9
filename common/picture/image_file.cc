// SPDX-License-Identifier: Apache-2.0
#include "common/picture/image_file.h"

#include <zlib.h>

#include <cstdint>
#include <opencv2/imgcodecs.hpp>

#include "common/picture/files.h"

namespace silhouette {
namespace {

constexpr std::string_view kPngSignature("\x89PNG\r\n\x1a\n", 8);

uint32_t BigEndian(std::string_view bytes, size_t at) {
  uint32_t number = 0;
  for (size_t i = at; i < at + 4; ++i) number = number << 8 | static_cast<uint8_t>(bytes[i]);
  return number;
}

// Whether the chunks of a PNG file are whole, up to the last.
bool HasWholeChunks(std::string_view png) {
  // A chunk: length of its data, type, data, check sum of type and data.
  for (size_t at = kPngSignature.size(); at + 12 <= png.size();) {
    const size_t length = BigEndian(png, at);
    if (length > png.size() - at - 12) return false;
    const std::string_view summed = png.substr(at + 4, 4 + length);
    const uLong sum = crc32_z(0, reinterpret_cast<const Bytef*>(summed.data()), summed.size());
    if (sum != BigEndian(png, at + 8 + length)) return false;
    if (summed.starts_with("IEND")) return true;
    at += 12 + length;
  }
  return false;
}

}  // namespace

cv::Mat ImageOfBytes(std::string_view bytes, int flags) {
  if (bytes.empty()) return {};
  if (bytes.starts_with(kPngSignature) && !HasWholeChunks(bytes)) return {};
  try {
    // OpenCV does not write to what it is only to read.
    return cv::imdecode(
        cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data())),
        flags);
  } catch (const cv::Exception&) {
    return {};  // too large an image, or a damaged one
  }
}

cv::Mat ImageOfFile(const std::string& path, int flags) {
  const auto bytes = ReadWholeFile(path);
  return bytes.ok() ? ImageOfBytes(*bytes, flags) : cv::Mat();
}

}  // namespace silhouette
