// SPDX-License-Identifier: Apache-2.0
#include "db/store/tile_value.h"

#include <xxhash.h>

#include <algorithm>

#include "db/store/schema.h"

namespace silhouette {

void RecordDigest::Add(std::string_view key, std::string_view value) {
  bytes_.append(key);
  bytes_.append(value.substr(0, schema::kChecksumSize));
}

uint64_t RecordDigest::Get() const { return XXH3_64bits(bytes_.data(), bytes_.size()); }

std::string EncodeTileValue(uint64_t tile, const TileHeader& header,
                            std::span<const std::byte> index, size_t page_size) {
  std::string value;
  value.reserve(std::max(kTileValueHeader + index.size(), page_size));
  value.append(schema::kChecksumSize, '\0');
  schema::AppendU64(value, header.digest);
  schema::AppendU64(value, header.unreadable);
  schema::AppendU64(value, header.coding);
  value.resize(kTileValueHeader);
  value.append(reinterpret_cast<const char*>(index.data()), index.size());
  if (value.size() < page_size) value.resize(page_size);
  schema::Seal(value, tile);
  return value;
}

std::optional<TileHeader> TileHeaderIn(std::string_view value) {
  if (value.size() < kTileValueHeader) return std::nullopt;
  return TileHeader{schema::ReadU64(value.data() + 8), schema::ReadU64(value.data() + 16),
                    schema::ReadU64(value.data() + 24)};
}

bool TileValueHolds(uint64_t tile, std::string_view value) {
  return value.size() >= kTileValueHeader && schema::IsSealed(value, tile);
}

std::span<const std::byte> TileIndexIn(std::string_view value) {
  const std::string_view index = value.substr(kTileValueHeader);
  return {reinterpret_cast<const std::byte*>(index.data()), index.size()};
}

}  // namespace silhouette
