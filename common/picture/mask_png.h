// SPDX-License-Identifier: Apache-2.0
// Masks as PNG images: one pixel of 8-bit grey per mask pixel, 255 set, 0 not.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "db/mask/mask.h"

namespace silhouette {

// The bytes of a PNG file. The mask has a valid size.
std::string EncodeMaskPng(const Mask& mask);

// An image file, PNG or any other kind that OpenCV reads, as 8-bit grey of the same size: 255 where
// it is white, 0 where it is black. InvalidArgument if it is no image, or has a pixel that is
// neither: an image of zeros and ones would else be taken for one with nothing in it.
absl::StatusOr<cv::Mat> DecodeBlackAndWhite(std::string_view bytes);

// The same as a mask: white is set, black is not. InvalidArgument also if it is not of the size
// `expected` (nothing: any size that a mask can have).
absl::StatusOr<Mask> DecodeMaskPng(std::string_view bytes,
                                   std::optional<MaskSize> expected = std::nullopt);

// The same with a file. NotFound: there is none. Messages name the file.
absl::StatusOr<Mask> ReadMaskPng(const std::string& path,
                                 std::optional<MaskSize> expected = std::nullopt);
absl::Status WriteMaskPng(const std::string& path, const Mask& mask);

}  // namespace silhouette
