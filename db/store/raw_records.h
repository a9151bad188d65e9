// SPDX-License-Identifier: Apache-2.0
// What a Snapshot consists of, and records of the sub-database `robot_images` of a variant as they
// are stored, by the tile.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "db/store/database_state.h"
#include "db/store/environment.h"

namespace silhouette {

// The records of a variant in the state of a transaction.
struct RecordSource {
  RecordSource(const DatabaseState& state, MDB_txn* the_transaction)
      : environment(*state.environment),
        transaction(the_transaction),
        records(state.robot_images),
        base(state.places.is_default() ? std::nullopt : std::optional(environment.robot_images())) {
  }

  Environment& environment;
  MDB_txn* transaction;
  MDB_dbi records;
  // Where the records are that these may rest on; nothing: they rest on none.
  std::optional<MDB_dbi> base;
};

struct RawRecord {
  std::string key;
  std::string value;
  // Where in the data file the value begins (PlaceInFile).
  std::optional<uint64_t> place;
  // The same of the record that it rests on (NeedsBase), if there is one.
  std::string base;
  std::optional<uint64_t> base_place;
};

// The value that one rests on which is stored under `number`; empty if it needs none, or there is
// none. The caller holds the map, as long as it looks at it.
std::string_view BaseOf(const RecordSource& source, ConfigurationNumber number,
                        std::string_view value);

// The keys of a tile: after `after` (empty: from the first) and before `end`.
struct KeyRange {
  std::string after;
  std::string end;  // empty: to the last
};
KeyRange KeysOfTile(uint64_t tile);

// Copies the first records of a range, about 1 MiB of them; none: there are no more. Holds the map
// meanwhile; so do the others.
absl::StatusOr<std::vector<RawRecord>> ReadChunk(const RecordSource& source, const KeyRange& keys);

// Calls `visit` for the records of a range in order, until it returns an error, which this returns
// too. Holds no map while it does.
absl::Status ForEachRecord(const RecordSource& source, KeyRange keys,
                           const std::function<absl::Status(const RawRecord&)>& visit);

// The first tile from `tile` on that has records; nothing if there is none.
absl::StatusOr<std::optional<uint64_t>> NextTileWithRecords(const RecordSource& source,
                                                            uint64_t tile);

// The digest (RecordDigest) of a tile's records; nothing if it has none. Reads their keys and the
// first bytes of their values.
absl::StatusOr<std::optional<uint64_t>> DigestOfTile(const RecordSource& source, uint64_t tile);

struct Snapshot::Impl {
  std::shared_ptr<const DatabaseState> state;
  // That of the snapshots of other variants, too, that were taken together
  // (Database::ReadVariants).
  std::shared_ptr<const ReadTransaction> held;
  uint64_t generation = 0;
  uint64_t size = 0;

  Environment& environment() const { return *state->environment; }
  MDB_txn* transaction() const { return held->get(); }
  RecordSource records() const { return {*state, transaction()}; }
  // A message of `meta`, as ReadMetaMessage.
  template <typename Message>
  absl::StatusOr<std::optional<Message>> Meta(std::string_view key) const {
    const auto hold = environment().HoldMap();
    return ReadMetaMessage<Message>(environment(), transaction(), key);
  }
};

}  // namespace silhouette
