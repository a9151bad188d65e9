// SPDX-License-Identifier: Apache-2.0
// Masks as PNG images: one pixel of 8-bit grey per mask pixel, 255 set, 0 not.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "db/mask/mask.h"

namespace silhouette {

// The bytes of a PNG file. The mask has a valid size.
std::string EncodeMaskPng(const Mask& mask);

// The mask in the bytes of an image file, PNG or any other kind that OpenCV reads: white is set,
// black is not. InvalidArgument if it is no image, is not of the size `expected` (nothing: any size
// that a mask can have), or has a pixel of another value: a mask of zeros and ones would else be
// taken for one with nothing in it.
absl::StatusOr<Mask> DecodeMaskPng(std::string_view bytes,
                                   std::optional<MaskSize> expected = std::nullopt);

// The same with a file. NotFound: there is none. Messages name the file.
absl::StatusOr<Mask> ReadMaskPng(const std::string& path,
                                 std::optional<MaskSize> expected = std::nullopt);
absl::Status WriteMaskPng(const std::string& path, const Mask& mask);

}  // namespace silhouette
