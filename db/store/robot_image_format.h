// SPDX-License-Identifier: Apache-2.0
// The bytes of one value in the sub-database `robot_images`.
//
//   offset  size  content
//   0       8     checksum: XXH3-64 of all bytes after it, seed = the configuration's number
//   8       1     flags: bit 0 excluded; the others are 0
//   9       1     codec of the masks: 0 as they are, 1 one LZ4 block, 2 shared with another record
//   10      1     c, number of commanded joint values
//   11      1     m, number of measured joint values
//   12      4     0
//   16      8     capture time: nanoseconds since 1970-01-01 UTC, signed
//   24      8 c   commanded joint values, IEEE 754 binary64
//   ...     8 m   measured joint values
//   ...     rest  the masks of all views one after another (Mask::ToBytes of each), put through the
//                 codec; nothing if excluded
//
// Shared (codec 2): the checksum (8 bytes) of the record of the same configuration in the default
// variant, its base, and one LZ4 block of the masks XOR the base's. A base never has this codec. A
// record whose base is not there, or has another checksum, is damaged.
//
// Integers and floating-point numbers are little-endian. The seed binds a value to its key: a value
// under another key fails its checksum.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "db/mask/mask.h"
#include "db/store/store.h"

namespace silhouette {

// The value for `image`. It must have the masks that its reader will expect (none if excluded) and
// at most 255 joint values of either kind.
std::string EncodeRobotImage(const RobotImage& image);

// Whether a value shares its masks with a base, without which they cannot be read.
bool NeedsBase(std::string_view value);

// The same record, its masks shared with `base`, which is stored under the same number; nothing if
// that would not be smaller, or one of the two cannot be read, is excluded or is shared itself.
std::optional<std::string> SharedValue(ConfigurationNumber number, std::string_view value,
                                       std::string_view base, std::span<const MaskSize> mask_sizes);

// The same record on its own, of one that is shared with `base`; nothing if it cannot be read.
std::optional<std::string> OwnValue(ConfigurationNumber number, std::string_view value,
                                    std::string_view base, std::span<const MaskSize> mask_sizes);

// The record in `value`, which is stored under `number`, of a cell with masks of these sizes.
// `base`: the value that it shares its masks with; empty if there is none. DataLoss, naming the
// number, if the checksum does not hold or the content does not fit.
absl::StatusOr<RobotImage> DecodeRobotImage(ConfigurationNumber number, std::string_view value,
                                            std::span<const MaskSize> mask_sizes,
                                            std::string_view base = {});

// Of the record in `value`, which can be decoded: its measured joint values, and when it was
// captured.
void ReadMeasured(std::string_view value, std::vector<double>& measured);
absl::Time ReadCaptured(std::string_view value);

// What a record says of a configuration's masks.
enum class StoredMasks {
  kDamaged,   // nothing: DecodeRobotImage gives DataLoss
  kExcluded,  // there are none
  kPresent,
};

// The masks of the record in `value`, without anything else of it: the words of all views, one
// after another, for which `words` has just the room. Only kPresent leaves something useful there.
// Allocates nothing but memory that a thread keeps.
StoredMasks DecodeMasks(ConfigurationNumber number, std::string_view value,
                        std::span<const MaskSize> mask_sizes, std::span<uint64_t> words,
                        std::string_view base = {});

}  // namespace silhouette
