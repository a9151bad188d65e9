// SPDX-License-Identifier: Apache-2.0
// The bytes of one value in the sub-database `collision_index`.
//
//   offset  size  content
//   0       8     checksum: XXH3-64 of all bytes after it, seed = the tile
//   8       8     digest of the tile's records that it was built from (RecordDigest)
//   16      8     how many of them could not be read; the index does not have them
//   24      8     coding: 0. Other values: the index rests on the default variant's, as earlier
//                 programs wrote it; such a tile is stale
//   32      16    0
//   48      ...   the index (db/index/tile_index.h)
//   ...           0 up to the size of a page of the database, if the value would be smaller
//
// Integers are little-endian. LMDB keeps a value of that size in pages of its own, behind their
// head of 16 bytes: the index begins at a multiple of 64 of the data file.
//
// The digest: XXH3-64, seed 0, of the key and the first 8 bytes of the value (all of it, if there
// are less) of every record of the tile, one after another. As these bytes are a record's checksum,
// it changes with every change of a record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace silhouette {

inline constexpr size_t kTileValueHeader = 48;

// Adds up the records of a tile, in the order of their numbers.
class RecordDigest {
 public:
  // `key`, `value`: as they are stored.
  void Add(std::string_view key, std::string_view value);
  uint64_t Get() const;
  bool empty() const { return bytes_.empty(); }

 private:
  std::string bytes_;
};

// What a value says without its index.
struct TileHeader {
  uint64_t digest = 0;
  uint64_t unreadable = 0;
  uint64_t coding = 0;  // other than 0: not as db/index/tile_index.h says; no program writes it
};

// The value for a tile. `page_size`: that of the database.
std::string EncodeTileValue(uint64_t tile, const TileHeader& header,
                            std::span<const std::byte> index, size_t page_size);

// Nothing if the value is too short.
std::optional<TileHeader> TileHeaderIn(std::string_view value);

// Whether the checksum of a value holds that is stored under `tile`.
bool TileValueHolds(uint64_t tile, std::string_view value);

// The index in a value, with what may fill it up.
std::span<const std::byte> TileIndexIn(std::string_view value);

}  // namespace silhouette
