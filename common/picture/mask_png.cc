// SPDX-License-Identifier: Apache-2.0
#include "common/picture/mask_png.h"

#include <cerrno>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/picture/files.h"
#include "common/picture/image_file.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

std::string SizeText(int width, int height) { return absl::StrCat(width, "x", height); }

// 255 where white is, a pixel being white or black in every channel; an image with a channel more
// than grey or colour need is opaque. `image` has 8 or 16 bits a channel.
absl::StatusOr<cv::Mat> WhiteOf(const cv::Mat& image) {
  cv::Mat values;
  image.convertTo(values, CV_16U);
  const int white = image.depth() == CV_8U ? 255 : 65535;
  const int channels = values.channels();
  const int colours = channels % 2 == 0 ? channels - 1 : channels;
  for (int y = 0; y < values.rows; ++y) {
    for (int x = 0; x < values.cols; ++x) {
      const uint16_t* const pixel = values.ptr<uint16_t>(y) + x * channels;
      if (colours < channels && pixel[colours] != white) {
        return absl::InvalidArgumentError(absl::StrCat("pixel (", x, ", ", y,
                                                       ") is transparent; a mask is black and "
                                                       "white, without transparency"));
      }
      for (int channel = 0; channel < colours; ++channel) {
        if (pixel[channel] != 0 && pixel[channel] != white) {
          return absl::InvalidArgumentError(
              absl::StrCat("pixel (", x, ", ", y, ") is neither black (0) nor white (", white,
                           ") but ", pixel[channel], "; a mask has only these two"));
        }
        if (pixel[channel] != pixel[0]) {
          return absl::InvalidArgumentError(
              absl::StrCat("pixel (", x, ", ", y,
                           ") is neither black nor white but coloured; a mask has only these two"));
        }
      }
    }
  }
  cv::Mat first;
  cv::extractChannel(values, first, 0);
  return cv::Mat(first == white);
}

// Of 8 or 16 bits a channel.
absl::StatusOr<cv::Mat> ImageOf(std::string_view bytes) {
  cv::Mat image = ImageOfBytes(bytes, cv::IMREAD_UNCHANGED);
  if (image.empty()) return absl::InvalidArgumentError("it is not an image");
  if (image.depth() != CV_8U && image.depth() != CV_16U) {
    return absl::InvalidArgumentError("it has neither 8 nor 16 bits a channel");
  }
  return image;
}

}  // namespace

std::string EncodeMaskPng(const Mask& mask) { return EncodePng(MaskImage(mask)); }

absl::StatusOr<cv::Mat> DecodeBlackAndWhite(std::string_view bytes) {
  ASSIGN_OR_RETURN(const cv::Mat image, ImageOf(bytes));
  return WhiteOf(image);
}

absl::StatusOr<Mask> DecodeMaskPng(std::string_view bytes, std::optional<MaskSize> expected) {
  ASSIGN_OR_RETURN(const cv::Mat image, ImageOf(bytes));
  const MaskSize size{image.cols, image.rows};
  if (expected && size != *expected) {
    return absl::InvalidArgumentError(absl::StrCat("it is ", SizeText(size.width, size.height),
                                                   " pixels large and should be ",
                                                   SizeText(expected->width, expected->height)));
  }
  if (!size.valid()) {
    return absl::InvalidArgumentError(absl::StrCat("it is ", SizeText(size.width, size.height),
                                                   " pixels large; a mask is at most 1024x1024"));
  }
  ASSIGN_OR_RETURN(const cv::Mat white, WhiteOf(image));
  return Mask::FromPredicate(size, [&](int x, int y) { return white.at<uint8_t>(y, x) != 0; });
}

absl::StatusOr<Mask> ReadMaskPng(const std::string& path, std::optional<MaskSize> expected) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(path));
  absl::StatusOr<Mask> mask = DecodeMaskPng(bytes, expected);
  if (mask.ok()) return mask;
  return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", mask.status().message()));
}

absl::Status WriteMaskPng(const std::string& path, const Mask& mask) {
  return WriteWholeFile(path, EncodeMaskPng(mask));
}

}  // namespace silhouette
