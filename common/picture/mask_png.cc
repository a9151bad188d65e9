// SPDX-License-Identifier: Apache-2.0
#include "common/picture/mask_png.h"

#include <cerrno>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/picture/files.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

std::string SizeText(int width, int height) { return absl::StrCat(width, "x", height); }

}  // namespace

std::string EncodeMaskPng(const Mask& mask) { return EncodePng(MaskImage(mask)); }

absl::StatusOr<Mask> DecodeMaskPng(std::string_view bytes, std::optional<MaskSize> expected) {
  cv::Mat grey;
  if (!bytes.empty()) {
    const cv::Mat input(1, static_cast<int>(bytes.size()), CV_8UC1,
                        const_cast<char*>(bytes.data()));
    try {
      grey = cv::imdecode(input, cv::IMREAD_GRAYSCALE);
    } catch (const cv::Exception&) {
      grey.release();
    }
  }
  if (grey.empty()) return absl::InvalidArgumentError("it is not an image");
  const MaskSize size{grey.cols, grey.rows};
  if (expected && size != *expected) {
    return absl::InvalidArgumentError(absl::StrCat("it is ", SizeText(size.width, size.height),
                                                   " pixels large and should be ",
                                                   SizeText(expected->width, expected->height)));
  }
  if (!size.valid()) {
    return absl::InvalidArgumentError(absl::StrCat("it is ", SizeText(size.width, size.height),
                                                   " pixels large; a mask is at most 1024x1024"));
  }
  return Mask::FromPredicate(size, [&](int x, int y) { return grey.at<uint8_t>(y, x) >= 128; });
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
