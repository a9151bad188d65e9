// SPDX-License-Identifier: Apache-2.0
#include "db/store/robot_image_format.h"

#include <lz4.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

constexpr size_t kHeaderSize = 24;
constexpr uint8_t kExcludedFlag = 1;
enum Codec : uint8_t { kRaw = 0, kLz4 = 1, kShared = 2 };

absl::Status DamagedImage(ConfigurationNumber number, std::string_view how) {
  return absl::DataLossError(absl::StrCat("robot image ", number, ": ", std::string(how)));
}

void AppendDoubles(std::string& bytes, std::span<const double> values) {
  for (double value : values) schema::AppendU64(bytes, std::bit_cast<uint64_t>(value));
}

std::vector<double> DoublesIn(std::string_view bytes) {
  std::vector<double> values(bytes.size() / 8);
  for (size_t i = 0; i < values.size(); ++i) {
    values[i] = std::bit_cast<double>(schema::ReadU64(bytes.data() + 8 * i));
  }
  return values;
}

// The LZ4 block of `bytes`; nothing if it would not be smaller.
std::optional<std::string> Compressed(const std::string& bytes) {
  if (bytes.size() < 2) return std::nullopt;
  std::string block(bytes.size() - 1, '\0');
  const int size = LZ4_compress_default(bytes.data(), block.data(), static_cast<int>(bytes.size()),
                                        static_cast<int>(block.size()));
  if (size <= 0) return std::nullopt;
  block.resize(static_cast<size_t>(size));
  return block;
}

// A value in its parts, which point into it.
struct Parts {
  bool excluded = false;
  uint8_t codec = kRaw;
  int64_t captured = 0;  // nanoseconds
  std::string_view commanded;
  std::string_view measured;
  std::string_view coded;
};

// Takes `value` apart. Null, or what is wrong with it.
const char* TakeApart(ConfigurationNumber number, std::string_view value, Parts& parts) {
  if (value.size() < kHeaderSize) return "its value is too short";
  if (!schema::IsSealed(value, number)) return "its checksum does not hold";
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(value[i]); };
  if ((byte(8) & ~kExcludedFlag) != 0) return "its flags are unknown";
  parts.excluded = (byte(8) & kExcludedFlag) != 0;
  parts.codec = byte(9);
  parts.captured = static_cast<int64_t>(schema::ReadU64(value.data() + 16));
  const size_t commanded = size_t{8} * byte(10);
  const size_t measured = size_t{8} * byte(11);
  const std::string_view rest = value.substr(kHeaderSize);
  if (rest.size() < commanded + measured) return "its joint values are cut off";
  parts.commanded = rest.substr(0, commanded);
  parts.measured = rest.substr(commanded, measured);
  parts.coded = rest.substr(commanded + measured);
  if (parts.excluded && !parts.coded.empty()) return "it is excluded and yet has masks";
  return nullptr;
}

size_t BytesOf(std::span<const MaskSize> mask_sizes) {
  size_t size = 0;
  for (const MaskSize mask_size : mask_sizes) size += mask_size.bytes();
  return size;
}

// As many bytes of `other`, eight at a time: readers wait for it.
void XorInto(std::span<char> bytes, std::string_view other) {
  size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    uint64_t word = 0;
    uint64_t with = 0;
    std::memcpy(&word, bytes.data() + i, 8);
    std::memcpy(&with, other.data() + i, 8);
    word ^= with;
    std::memcpy(bytes.data() + i, &word, 8);
  }
  for (; i < bytes.size(); ++i) bytes[i] = static_cast<char>(bytes[i] ^ other[i]);
}

// Writes what `coded` is without its codec; false if that does not just fill `bytes`.
bool Decode(uint8_t codec, std::string_view coded, std::span<char> bytes) {
  if (codec == kRaw) {
    if (coded.size() != bytes.size()) return false;
    std::memcpy(bytes.data(), coded.data(), coded.size());
    return true;
  }
  if (codec != kLz4) return false;
  const auto size = static_cast<int>(bytes.size());
  return LZ4_decompress_safe(coded.data(), bytes.data(), static_cast<int>(coded.size()), size) ==
         size;
}

// The same for a value that may be shared with `base`.
bool DecodeParts(ConfigurationNumber number, const Parts& parts, std::string_view base,
                 std::span<char> bytes) {
  if (parts.codec != kShared) return Decode(parts.codec, parts.coded, bytes);
  Parts base_parts;
  if (parts.coded.size() < schema::kChecksumSize ||
      TakeApart(number, base, base_parts) != nullptr ||
      base.substr(0, schema::kChecksumSize) != parts.coded.substr(0, schema::kChecksumSize) ||
      base_parts.excluded || base_parts.codec == kShared) {
    return false;
  }
  thread_local std::string base_bytes;
  base_bytes.resize(bytes.size());
  if (!Decode(base_parts.codec, base_parts.coded, base_bytes) ||
      !Decode(kLz4, parts.coded.substr(schema::kChecksumSize), bytes)) {
    return false;
  }
  XorInto(bytes, base_bytes);
  return true;
}

// The same record with another codec of its masks.
std::string Recoded(ConfigurationNumber number, std::string_view value, const Parts& parts,
                    Codec codec, std::string_view coded) {
  std::string recoded(value.substr(0, value.size() - parts.coded.size()));
  recoded[9] = static_cast<char>(codec);
  recoded += coded;
  schema::Seal(recoded, number);
  return recoded;
}

// The words of a mask from its form on disk; false if a bit beyond the last pixel is set.
bool ToWords(MaskSize size, const char* bytes, uint64_t* words) {
  const size_t count = size.words();
  words[count - 1] = 0;
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(words, bytes, size.bytes());
  } else {
    std::fill_n(words, count, 0);
    for (size_t i = 0; i < size.bytes(); ++i) {
      words[i / 8] |= static_cast<uint64_t>(static_cast<uint8_t>(bytes[i])) << (8 * (i % 8));
    }
  }
  const size_t used = size.pixels() % 64;
  return used == 0 || words[count - 1] >> used == 0;
}

// The words of all masks of a record, one view after another; false if they do not fit the views.
bool DecodeWords(ConfigurationNumber number, const Parts& parts, std::string_view base,
                 std::span<const MaskSize> mask_sizes, std::span<uint64_t> words) {
  thread_local std::string bytes;
  bytes.resize(BytesOf(mask_sizes));
  if (!DecodeParts(number, parts, base, bytes)) return false;
  const char* from = bytes.data();
  uint64_t* to = words.data();
  for (const MaskSize size : mask_sizes) {
    if (!ToWords(size, from, to)) return false;
    from += size.bytes();
    to += size.words();
  }
  return true;
}

}  // namespace

std::string EncodeRobotImage(const RobotImage& image) {
  std::string masks;
  for (const Mask& mask : image.masks) masks += mask.ToBytes();
  const std::optional<std::string> compressed = Compressed(masks);

  std::string value(schema::kChecksumSize, '\0');
  value.push_back(static_cast<char>(image.excluded ? kExcludedFlag : 0));
  value.push_back(static_cast<char>(compressed ? kLz4 : kRaw));
  value.push_back(static_cast<char>(image.commanded.size()));
  value.push_back(static_cast<char>(image.measured.size()));
  value.append(4, '\0');
  schema::AppendU64(value, static_cast<uint64_t>(absl::ToUnixNanos(image.captured)));
  AppendDoubles(value, image.commanded);
  AppendDoubles(value, image.measured);
  value += compressed ? *compressed : masks;
  schema::Seal(value, image.number);
  return value;
}

bool NeedsBase(std::string_view value) {
  return value.size() >= kHeaderSize && static_cast<uint8_t>(value[9]) == kShared;
}

std::optional<std::string> SharedValue(ConfigurationNumber number, std::string_view value,
                                       std::string_view base,
                                       std::span<const MaskSize> mask_sizes) {
  Parts parts;
  Parts base_parts;
  if (TakeApart(number, value, parts) != nullptr || parts.excluded || NeedsBase(value) ||
      TakeApart(number, base, base_parts) != nullptr || base_parts.excluded || NeedsBase(base)) {
    return std::nullopt;
  }
  std::string bytes(BytesOf(mask_sizes), '\0');
  std::string base_bytes(bytes.size(), '\0');
  if (!Decode(parts.codec, parts.coded, bytes) ||
      !Decode(base_parts.codec, base_parts.coded, base_bytes)) {
    return std::nullopt;
  }
  XorInto(bytes, base_bytes);
  const std::optional<std::string> block = Compressed(bytes);
  if (!block || schema::kChecksumSize + block->size() >= parts.coded.size()) return std::nullopt;
  return Recoded(number, value, parts, kShared,
                 std::string(base.substr(0, schema::kChecksumSize)) + *block);
}

std::optional<std::string> OwnValue(ConfigurationNumber number, std::string_view value,
                                    std::string_view base, std::span<const MaskSize> mask_sizes) {
  Parts parts;
  if (TakeApart(number, value, parts) != nullptr || parts.codec != kShared) return std::nullopt;
  std::string bytes(BytesOf(mask_sizes), '\0');
  if (!DecodeParts(number, parts, base, bytes)) return std::nullopt;
  const std::optional<std::string> compressed = Compressed(bytes);
  return compressed ? Recoded(number, value, parts, kLz4, *compressed)
                    : Recoded(number, value, parts, kRaw, bytes);
}

absl::StatusOr<RobotImage> DecodeRobotImage(ConfigurationNumber number, std::string_view value,
                                            std::span<const MaskSize> mask_sizes,
                                            std::string_view base) {
  Parts parts;
  if (const char* how = TakeApart(number, value, parts)) return DamagedImage(number, how);
  RobotImage image;
  image.number = number;
  image.excluded = parts.excluded;
  image.captured = absl::FromUnixNanos(parts.captured);
  image.commanded = DoublesIn(parts.commanded);
  image.measured = DoublesIn(parts.measured);
  if (image.excluded) return image;
  size_t count = 0;
  for (const MaskSize size : mask_sizes) count += size.words();
  std::vector<uint64_t> words(count);
  if (!DecodeWords(number, parts, base, mask_sizes, words)) {
    return DamagedImage(
        number, parts.codec == kShared
                    ? "the record of the default variant that it rests on is missing or different"
                    : "its masks do not fit the views");
  }
  const uint64_t* next = words.data();
  for (const MaskSize size : mask_sizes) {
    image.masks.push_back(Mask::FromWords(size, {next, next + size.words()}));
    next += size.words();
  }
  return image;
}

void ReadMeasured(std::string_view value, std::vector<double>& measured) {
  const size_t commanded = static_cast<uint8_t>(value[10]);
  measured.resize(static_cast<uint8_t>(value[11]));
  for (size_t i = 0; i < measured.size(); ++i) {
    measured[i] =
        std::bit_cast<double>(schema::ReadU64(value.data() + kHeaderSize + 8 * (commanded + i)));
  }
}

absl::Time ReadCaptured(std::string_view value) {
  return absl::FromUnixNanos(static_cast<int64_t>(schema::ReadU64(value.data() + 16)));
}

StoredMasks DecodeMasks(ConfigurationNumber number, std::string_view value,
                        std::span<const MaskSize> mask_sizes, std::span<uint64_t> words,
                        std::string_view base) {
  Parts parts;
  if (TakeApart(number, value, parts) != nullptr) return StoredMasks::kDamaged;
  if (parts.excluded) return StoredMasks::kExcluded;
  return DecodeWords(number, parts, base, mask_sizes, words) ? StoredMasks::kPresent
                                                             : StoredMasks::kDamaged;
}

}  // namespace silhouette
