// SPDX-License-Identifier: Apache-2.0
#include "db/store/raw_image_format.h"

#include <xxhash.h>

#include "absl/strings/str_cat.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

constexpr size_t kRawImageFormatHeaderSize = 32;
constexpr char kPng = 1;
constexpr uint64_t kReferences = ~uint64_t{0};

uint64_t SeedOf(ConfigurationNumber number, uint64_t view) { return number ^ view << 56; }

}  // namespace

std::string EncodeRawImageKey(ConfigurationNumber number, uint64_t view) {
  return schema::EncodeKey(number) + schema::EncodeKey(view);
}

std::string EncodeReferencesKey(uint64_t id) { return EncodeRawImageKey(kReferences, id); }

std::optional<ConfigurationNumber> NumberInRawImageKey(std::string_view key) {
  if (key.size() != 16) return std::nullopt;
  const std::optional<uint64_t> number = schema::DecodeKey(key.substr(0, 8));
  return number == kReferences ? std::nullopt : number;
}

uint64_t IdOfReferences(std::string_view payload) {
  return XXH3_64bits(payload.data(), payload.size());
}

std::string EncodeRawImage(ConfigurationNumber number, uint64_t view, const RawImage& image) {
  std::string value(schema::kChecksumSize, '\0');
  value.reserve(kRawImageFormatHeaderSize + image.png.size());
  schema::AppendU64(value, static_cast<uint64_t>(absl::ToUnixNanos(image.captured)));
  schema::AppendU64(value, image.references);
  value.push_back(kPng);
  value.append(7, '\0');
  value += image.png;
  schema::Seal(value, SeedOf(number, view));
  return value;
}

absl::StatusOr<RawImage> DecodeRawImage(ConfigurationNumber number, uint64_t view,
                                        std::string_view value) {
  if (value.size() < kRawImageFormatHeaderSize || !schema::IsSealed(value, SeedOf(number, view)) ||
      value[24] != kPng) {
    return absl::DataLossError(
        absl::StrCat("the raw image of configuration ", number, ", view ", view, ", is damaged"));
  }
  return RawImage{
      .captured = absl::FromUnixNanos(static_cast<int64_t>(schema::ReadU64(value.data() + 8))),
      .references = schema::ReadU64(value.data() + 16),
      .png = std::string(value.substr(kRawImageFormatHeaderSize))};
}

}  // namespace silhouette
