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

}  // namespace

VariantPlaces PlacesOfVariant(const std::string& name) {
  const std::string behind = name == kDefaultVariant ? "" : "/" + name;
  return {.name = name,
          .robot_images = kRobotImages + behind,
          .collision_index = kCollisionIndex + behind,
          .raw_images = kRawImages + behind,
          .capture_key = std::string(kCaptureKey) + behind};
}

bool IsVariantName(std::string_view name) {
  return !name.empty() && name.size() <= 32 && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
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

std::string SealMeta(std::string_view payload) {
  std::string value;
  value.reserve(8 + payload.size());
  AppendU64(value, XXH3_64bits(payload.data(), payload.size()));
  value.append(payload);
  return value;
}

std::optional<std::string_view> OpenMeta(std::string_view value) {
  if (value.size() < 8) return std::nullopt;
  const std::string_view payload = value.substr(8);
  if (ReadU64(value.data()) != XXH3_64bits(payload.data(), payload.size())) return std::nullopt;
  return payload;
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
