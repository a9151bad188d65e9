#include "db/robot_image_format.h"

#include <lz4.h>
#include <xxhash.h>

#include <bit>
#include <optional>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/schema.h"

namespace silhouette {
namespace {

constexpr size_t kChecksumSize = 8;
constexpr size_t kHeaderSize = 24;
constexpr uint8_t kExcludedFlag = 1;
enum Codec : uint8_t { kRaw = 0, kLz4 = 1 };

uint64_t Checksum(ConfigurationNumber number, std::string_view value) {
  const std::string_view content = value.substr(kChecksumSize);
  return XXH3_64bits_withSeed(content.data(), content.size(), number);
}

absl::Status Damaged(ConfigurationNumber number, std::string_view how) {
  return absl::DataLossError(absl::StrCat("robot image ", number, ": ", std::string(how)));
}

void AppendDoubles(std::string& bytes, std::span<const double> values) {
  for (double value : values) schema::AppendU64(bytes, std::bit_cast<uint64_t>(value));
}

// Takes `count` values from the front of `bytes`.
std::vector<double> TakeDoubles(std::string_view& bytes, size_t count) {
  std::vector<double> values(count);
  for (double& value : values) {
    value = std::bit_cast<double>(schema::ReadU64(bytes.data()));
    bytes.remove_prefix(8);
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

// `coded` without its codec; nothing if that does not give `size` bytes.
std::optional<std::string> Decoded(uint8_t codec, std::string_view coded, size_t size) {
  if (codec == kRaw) {
    if (coded.size() != size) return std::nullopt;
    return std::string(coded);
  }
  if (codec != kLz4) return std::nullopt;
  std::string bytes(size, '\0');
  const int got = LZ4_decompress_safe(coded.data(), bytes.data(), static_cast<int>(coded.size()),
                                      static_cast<int>(size));
  if (got != static_cast<int>(size)) return std::nullopt;
  return bytes;
}

}  // namespace

std::string EncodeRobotImage(const RobotImage& image) {
  std::string masks;
  for (const Mask& mask : image.masks) masks += mask.ToBytes();
  const std::optional<std::string> compressed = Compressed(masks);

  std::string value(kChecksumSize, '\0');
  value.push_back(static_cast<char>(image.excluded ? kExcludedFlag : 0));
  value.push_back(static_cast<char>(compressed ? kLz4 : kRaw));
  value.push_back(static_cast<char>(image.commanded.size()));
  value.push_back(static_cast<char>(image.measured.size()));
  value.append(4, '\0');
  schema::AppendU64(value, static_cast<uint64_t>(absl::ToUnixNanos(image.captured)));
  AppendDoubles(value, image.commanded);
  AppendDoubles(value, image.measured);
  value += compressed ? *compressed : masks;

  std::string checksum;
  schema::AppendU64(checksum, Checksum(image.number, value));
  value.replace(0, kChecksumSize, checksum);
  return value;
}

absl::StatusOr<RobotImage> DecodeRobotImage(ConfigurationNumber number, std::string_view value,
                                            std::span<const MaskSize> mask_sizes) {
  if (value.size() < kHeaderSize) return Damaged(number, "its value is too short");
  if (schema::ReadU64(value.data()) != Checksum(number, value)) {
    return Damaged(number, "its checksum does not hold");
  }
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(value[i]); };
  if ((byte(8) & ~kExcludedFlag) != 0) return Damaged(number, "its flags are unknown");
  RobotImage image;
  image.number = number;
  image.excluded = (byte(8) & kExcludedFlag) != 0;
  image.captured = absl::FromUnixNanos(static_cast<int64_t>(schema::ReadU64(value.data() + 16)));
  std::string_view rest = value.substr(kHeaderSize);
  if (rest.size() < size_t{8} * (byte(10) + byte(11))) {
    return Damaged(number, "its joint values are cut off");
  }
  image.commanded = TakeDoubles(rest, byte(10));
  image.measured = TakeDoubles(rest, byte(11));
  if (image.excluded) {
    if (!rest.empty()) return Damaged(number, "it is excluded and yet has masks");
    return image;
  }
  size_t size = 0;
  for (MaskSize mask_size : mask_sizes) size += mask_size.bytes();
  const std::optional<std::string> bytes = Decoded(byte(9), rest, size);
  if (!bytes) return Damaged(number, "its masks do not fit the views");
  std::span<const uint8_t> left(reinterpret_cast<const uint8_t*>(bytes->data()), bytes->size());
  try {
    for (MaskSize mask_size : mask_sizes) {
      image.masks.push_back(Mask::FromBytes(mask_size, left.first(mask_size.bytes())));
      left = left.subspan(mask_size.bytes());
    }
  } catch (const std::invalid_argument& error) {
    return Damaged(number, error.what());
  }
  return image;
}

}  // namespace silhouette
