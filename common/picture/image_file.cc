// SPDX-License-Identifier: Apache-2.0
#include "common/picture/image_file.h"

#include <zlib.h>

#include <bit>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>

#include "common/picture/files.h"
#include "db/status/status_macros.h"

// After <cstdio>, which they need.
#include <jerror.h>
#include <jpeglib.h>

namespace silhouette {
namespace {

constexpr std::string_view kPngSignature("\x89PNG\r\n\x1a\n", 8);
constexpr std::string_view kJpegSignature("\xff\xd8\xff");

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

struct JpegErrors : jpeg_error_mgr {
  std::jmp_buf back;
  bool incomplete = false;
};

[[noreturn]] void EndJpeg(j_common_ptr jpeg) {
  std::longjmp(static_cast<JpegErrors*>(jpeg->err)->back, 1);
}

// libjpeg warns of what it makes up for. Bytes after the last pixel, which some cameras send, are
// harmless.
void NoteJpegWarning(j_common_ptr jpeg, int level) {
  if (level < 0 && jpeg->err->msg_code != JWRN_EXTRANEOUS_DATA) {
    static_cast<JpegErrors*>(jpeg->err)->incomplete = true;
  }
}

// Whether `bytes` are a whole JPEG image, which is then in `image`. OpenCV takes one that stops in
// its middle, without a word.
bool ReadJpeg(std::string_view bytes, int flags, cv::Mat& image) {
  JpegErrors errors;
  jpeg_decompress_struct jpeg{};
  jpeg.err = jpeg_std_error(&errors);
  errors.error_exit = EndJpeg;
  errors.emit_message = NoteJpegWarning;
  if (setjmp(errors.back) != 0) {
    jpeg_destroy_decompress(&jpeg);
    return false;
  }
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  const cv::Size2d size(jpeg.image_width, jpeg.image_height);
  if (size.area() > kMostImagePixels) EndJpeg(reinterpret_cast<j_common_ptr>(&jpeg));
  const bool grey = (flags & cv::IMREAD_ANYCOLOR) != 0 ? jpeg.num_components == 1
                                                       : (flags & cv::IMREAD_COLOR) == 0;
  jpeg.out_color_space = grey ? JCS_GRAYSCALE : JCS_EXT_BGR;
  jpeg_start_decompress(&jpeg);
  image.create(size, grey ? CV_8UC1 : CV_8UC3);
  while (jpeg.output_scanline < jpeg.output_height && !errors.incomplete) {
    JSAMPROW row = image.ptr(static_cast<int>(jpeg.output_scanline));
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  // Zeros in place of the rest may pass for pixels, but not for the end.
  if (!errors.incomplete) jpeg_finish_decompress(&jpeg);
  jpeg_destroy_decompress(&jpeg);
  return !errors.incomplete;
}

}  // namespace

cv::Mat ImageOfBytes(std::string_view bytes, int flags) {
  if (bytes.empty()) return {};
  if (bytes.starts_with(kPngSignature) && !HasWholeChunks(bytes)) return {};
  try {
    if (bytes.starts_with(kJpegSignature)) {
      cv::Mat image;
      return ReadJpeg(bytes, flags, image) ? image : cv::Mat();
    }
    // OpenCV does not write to what it is only to read.
    return cv::imdecode(
        cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data())),
        flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    return {};  // too large an image, or a damaged one
  }
}

absl::Status CheckUsedBits(const std::string& name, std::string_view bytes, const cv::Mat& image) {
  constexpr double kMost = (1 << 12) - 1;
  if (cv::norm(image, cv::NORM_INF) > kMost / 256) return absl::OkStatus();
  const cv::Mat deep = ImageOfBytes(bytes, cv::IMREAD_ANYCOLOR | cv::IMREAD_ANYDEPTH);
  if (deep.empty() || deep.depth() != CV_16U) return absl::OkStatus();
  const auto most = static_cast<unsigned>(cv::norm(deep, cv::NORM_INF));
  if (most == 0 || most > kMost) return absl::OkStatus();
  cv::Mat low;
  cv::bitwise_and(deep.reshape(1), 0xF, low);
  if (cv::countNonZero(low) == 0) return absl::OkStatus();  // 12 bits, the upper ones
  return InvalidArgument(name, " uses the lower ", std::bit_width(most),
                         " of its 16 bits, of which the upper 8 are read; light the view if it is "
                         "dark, or convert all its images to 8 bits, by the same factor");
}

cv::Mat ImageOfFile(const std::string& path, int flags) {
  const auto bytes = ReadWholeFile(path);
  return bytes.ok() ? ImageOfBytes(*bytes, flags) : cv::Mat();
}

}  // namespace silhouette
