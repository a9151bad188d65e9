// SPDX-License-Identifier: Apache-2.0
#include "db/store/schema.h"

#include <xxhash.h>

#include <algorithm>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace silhouette::schema {
namespace {

constexpr char kFormatPrefix[] = "silhouette ";

uint64_t ChecksumOf(std::string_view value, uint64_t seed) {
  const std::string_view content = value.substr(kChecksumSize);
  return XXH3_64bits_withSeed(content.data(), content.size(), seed);
}

}  // namespace

VariantPlaces PlacesOfVariant(const std::string& name) {
  const std::string behind = name == kDefaultVariant ? "" : "/" + name;
  return {.name = name,
          .robot_images = kRobotImages + behind,
          .collision_index = kCollisionIndex + behind,
          .raw_images = kRawImages + behind,
          .capture_key = std::string(kCaptureKey) + behind,
          .drawn_key = std::string(kDrawnKey) + behind};
}

bool IsVariantName(std::string_view name) {
  return !name.empty() && name.size() <= 32 && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

Names KeysOfMeta(const std::vector<std::string>& variants) {
  Names keys;
  for (const std::string_view key :
       {kFormatKey, kCellKey, kReferencesKey, kCalibrationKey, kVerificationKey, kProvenanceKey,
        kVariantsKey, kGenerationKey}) {
    keys.emplace(key);
  }
  for (const std::string& variant : variants) {
    const VariantPlaces places = PlacesOfVariant(variant);
    keys.insert({places.capture_key, places.drawn_key});
  }
  return keys;
}

Names SubDatabases(const std::vector<std::string>& variants) {
  Names names = {kMeta};
  for (const std::string& variant : variants) {
    const VariantPlaces places = PlacesOfVariant(variant);
    names.insert({places.robot_images, places.collision_index, places.raw_images});
  }
  return names;
}

std::string FormatValue() { return absl::StrCat(kFormatPrefix, kFormatVersion); }

std::optional<int> FormatVersionIn(std::string_view value) {
  absl::string_view digits(value.data(), value.size());
  int version = 0;
  if (!absl::ConsumePrefix(&digits, kFormatPrefix) || !absl::SimpleAtoi(digits, &version)) {
    return std::nullopt;
  }
  return version;
}

void Seal(std::string& value, uint64_t seed) {
  std::string checksum;
  AppendU64(checksum, ChecksumOf(value, seed));
  value.replace(0, kChecksumSize, checksum);
}

bool IsSealed(std::string_view value, uint64_t seed) {
  return value.size() >= kChecksumSize && ReadU64(value.data()) == ChecksumOf(value, seed);
}

std::string SealMeta(std::string_view payload) {
  std::string value(kChecksumSize, '\0');
  value.append(payload);
  Seal(value);
  return value;
}

std::optional<std::string_view> OpenMeta(std::string_view value) {
  if (!IsSealed(value)) return std::nullopt;
  return value.substr(kChecksumSize);
}

std::string EncodeGeneration(uint64_t generation) {
  std::string payload;
  AppendU64(payload, generation);
  return payload;
}

std::optional<uint64_t> DecodeGeneration(std::string_view payload) {
  if (payload.size() != 8) return std::nullopt;
  return ReadU64(payload.data());
}

NumberKey EncodeKey(uint64_t number) {
  NumberKey key;
  for (int i = 0; i < 8; ++i) key.push_back(static_cast<char>(number >> (56 - 8 * i)));
  return key;
}

std::optional<uint64_t> DecodeKey(std::string_view key) {
  if (key.size() != 8) return std::nullopt;
  uint64_t number = 0;
  for (char byte : key) number = number << 8 | static_cast<uint8_t>(byte);
  return number;
}

void AppendU64(std::string& bytes, uint64_t value) {
  for (int i = 0; i < 8; ++i) bytes.push_back(static_cast<char>(value >> (8 * i)));
}

uint64_t ReadU64(const char* bytes) {
  uint64_t value = 0;
  for (int i = 7; i >= 0; --i) value = value << 8 | static_cast<uint8_t>(bytes[i]);
  return value;
}

}  // namespace silhouette::schema
