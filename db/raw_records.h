// Records of the sub-database `robot_images` as they are stored, by the tile.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "db/environment.h"

namespace silhouette {

struct RawRecord {
  std::string key;
  std::string value;
  // Where in the data file the value begins (PlaceInFile).
  std::optional<uint64_t> place;
};

// The keys of a tile: after `after` (empty: from the first) and before `end`.
struct KeyRange {
  std::string after;
  std::string end;  // empty: to the last
};
KeyRange KeysOfTile(uint64_t tile);

// Copies the first records of a range, about 1 MiB of them; none: there are no more. Holds the map
// meanwhile; so do the others.
absl::StatusOr<std::vector<RawRecord>> ReadChunk(Environment& environment, MDB_txn* transaction,
                                                 const KeyRange& keys);

// The first tile from `tile` on that has records; nothing if there is none.
absl::StatusOr<std::optional<uint64_t>> NextTileWithRecords(Environment& environment,
                                                            MDB_txn* transaction, uint64_t tile);

// The digest (RecordDigest) of a tile's records; nothing if it has none. Reads their keys and the
// first bytes of their values.
absl::StatusOr<std::optional<uint64_t>> DigestOfTile(Environment& environment, MDB_txn* transaction,
                                                     uint64_t tile);

}  // namespace silhouette
