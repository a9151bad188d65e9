// SPDX-License-Identifier: Apache-2.0
// The bytes of the sub-database `raw_images`: the camera images that robot images were made from.
//
// Keys are two u64, big-endian: the configuration number and the view's place in
// CellDescription.views; or 2^64 - 1 and the id of reference images, which is XXH3-64, seed 0, of
// their payload (the message References as it lies in `meta`).
//
// Under the former, the camera images of one view:
//
//   offset  size  content
//   0       8     checksum: XXH3-64 of all bytes after it; the seed is the configuration number
//                 XOR 2^56 times the view's place
//   8       8     capture time: nanoseconds since 1970-01-01 UTC, signed
//   16      8     id of the reference images that its mask was made with
//   24      1     codec: 1 PNG files; others are not used
//   25      7     0
//   32      rest  the images that the mask unites, one file after another; the last one taken is
//                 the first
//
// Under the latter, the reference images as a value of `meta`: checksum, payload.
//
// Integers of values are little-endian.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "db/store/store.h"

namespace silhouette {

std::string EncodeRawImageKey(ConfigurationNumber number, uint64_t view);
// Of reference images.
std::string EncodeReferencesKey(uint64_t id);
// The configuration number in a key; nothing if it is that of reference images, or damaged.
std::optional<ConfigurationNumber> NumberInRawImageKey(std::string_view key);

uint64_t IdOfReferences(std::string_view payload);

std::string EncodeRawImage(ConfigurationNumber number, uint64_t view, const RawImage& image);
// DataLoss, naming number and view, if the checksum does not hold or the codec is unknown.
absl::StatusOr<RawImage> DecodeRawImage(ConfigurationNumber number, uint64_t view,
                                        std::string_view value);

}  // namespace silhouette
