// SPDX-License-Identifier: Apache-2.0
#include "db/store/collision_index.h"

#include <sys/mman.h>
#include <sys/stat.h>

#include <cerrno>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/raw_records.h"
#include "db/store/read_at.h"
#include "db/store/schema.h"
#include "db/store/tile_value.h"

namespace silhouette {
// The data file, mapped for reading.
class CollisionIndex::File {
 public:
  static absl::StatusOr<std::unique_ptr<const File>> Map(const Environment& environment) {
    mdb_filehandle_t file = -1;
    if (const int code = mdb_env_get_fd(environment.get(), &file); code != 0) {
      return environment.ReadError(code);
    }
    struct stat status {};
    if (fstat(file, &status) != 0) return environment.ReadError(errno);
    const auto size = static_cast<size_t>(status.st_size);
    void* map = mmap(nullptr, size, PROT_READ, MAP_SHARED, file, 0);
    if (map == MAP_FAILED) return environment.ReadError(errno);
    return std::unique_ptr<const File>(new File(file, static_cast<const char*>(map), size));
  }
  ~File() { munmap(const_cast<char*>(map_), size_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  // A value where it lies in the file, which LMDB shows in its own map. Nothing if it does not.
  std::optional<std::string_view> Find(std::string_view shown, size_t page_size) const {
    const std::optional<uint64_t> offset = OffsetInFile(shown, page_size);
    if (!offset || *offset > size_ || shown.size() > size_ - *offset) return std::nullopt;
    const std::string_view value(map_ + *offset, shown.size());
    if (value.substr(0, kTileValueHeader) != shown.substr(0, kTileValueHeader)) return std::nullopt;
    return value;
  }

  // Reads a value that Find() gave from the file; false if that fails.
  bool Read(std::string_view value, std::string& bytes) const {
    bytes.resize(value.size());
    return ReadAt(file_, static_cast<uint64_t>(value.data() - map_), bytes);
  }

 private:
  File(int file, const char* map, size_t size) : file_(file), map_(map), size_(size) {}

  const int file_;  // the environment's
  const char* const map_;
  const size_t size_;
};

struct CollisionIndex::Entry {
  // As stored: its header if there is a value; where it lies, if that makes sense.
  std::optional<TileHeader> header;
  std::optional<std::string_view> value;
  uint64_t bytes = 0;
  // Of the tile's records; nothing if it has none.
  std::optional<uint64_t> digest;

  mutable std::once_flag checked;
  mutable std::optional<TileIndex> index;
  mutable TileState state = TileState::kMissing;
};

CollisionIndex::CollisionIndex(std::shared_ptr<const Snapshot> snapshot)
    : snapshot_(std::move(snapshot)) {
  for (const MaskSize size : snapshot_->impl_->state->mask_sizes) trees_.emplace_back(size);
}

CollisionIndex::~CollisionIndex() = default;

absl::StatusOr<std::shared_ptr<const CollisionIndex>> CollisionIndex::Open(Snapshot snapshot) {
  return Open(std::make_shared<const Snapshot>(std::move(snapshot)));
}

absl::StatusOr<std::shared_ptr<const CollisionIndex>> CollisionIndex::Open(
    std::shared_ptr<const Snapshot> snapshot) {
  std::shared_ptr<CollisionIndex> index(new CollisionIndex(std::move(snapshot)));
  ASSIGN_OR_RETURN(std::unique_ptr<const File> file,
                   File::Map(index->snapshot_->impl_->environment()));
  index->file_ = std::move(file);
  RETURN_IF_ERROR(index->ReadHeads());
  RETURN_IF_ERROR(index->ReadDigests());
  return index;
}

CollisionIndex::Entry& CollisionIndex::EntryOf(uint64_t tile) {
  std::unique_ptr<Entry>& entry = tiles_[tile];
  if (entry == nullptr) entry = std::make_unique<Entry>();
  return *entry;
}

// Takes down what is stored for which tile.
absl::Status CollisionIndex::ReadHeads() {
  Environment& environment = snapshot_->impl_->environment();
  ASSIGN_OR_RETURN(const std::optional<MDB_dbi> database,
                   environment.Find(snapshot_->impl_->state->places.collision_index));
  if (!database) return absl::OkStatus();
  const auto hold = environment.HoldMap();
  return environment.ForEachEntry(snapshot_->impl_->transaction(), *database, "",
                                  [&](std::string_view key, std::string_view shown) {
                                    const std::optional<uint64_t> tile = schema::DecodeKey(key);
                                    if (!tile || *tile >= snapshot_->impl_->state->grid.tiles())
                                      return true;
                                    Entry& entry = EntryOf(*tile);
                                    entry.header = TileHeaderIn(shown).value_or(TileHeader());
                                    entry.value = file_->Find(shown, environment.PageSize());
                                    entry.bytes = shown.size();
                                    return true;
                                  });
}

absl::Status CollisionIndex::ReadDigests() {
  const RecordSource records = snapshot_->impl_->records();
  for (uint64_t tile = 0;; ++tile) {
    ASSIGN_OR_RETURN(const auto next, NextTileWithRecords(records, tile));
    if (!next || *next >= snapshot_->impl_->state->grid.tiles()) return absl::OkStatus();
    tile = *next;
    Entry& entry = EntryOf(tile);
    // Where there is no index, it does not matter.
    if (!entry.header) {
      entry.digest = 0;
      continue;
    }
    ASSIGN_OR_RETURN(const auto digest, DigestOfTile(records, tile));
    entry.digest = digest;
  }
}

void CollisionIndex::Check(uint64_t tile, const Entry& entry) const {
  if (!entry.header) {
    entry.state = TileState::kMissing;
  } else if (!entry.value || !TileValueHolds(tile, *entry.value)) {
    entry.state = TileState::kDamaged;
  } else if (entry.digest != entry.header->digest || entry.header->coding != 0) {
    entry.state = TileState::kStale;
  } else {
    try {
      entry.index.emplace(TileIndexIn(*entry.value), trees_);
      entry.state = TileState::kFresh;
    } catch (const std::invalid_argument&) {
      entry.state = TileState::kDamaged;
    }
  }
}

// Null if there is nothing of the tile.
const CollisionIndex::Entry* CollisionIndex::Checked(uint64_t tile) const {
  const auto found = tiles_.find(tile);
  if (found == tiles_.end()) return nullptr;
  const Entry& entry = *found->second;
  std::call_once(entry.checked, [&] { Check(tile, entry); });
  return &entry;
}

const TileIndex* CollisionIndex::Tile(uint64_t tile) const {
  const Entry* entry = Checked(tile);
  return entry != nullptr && entry->index ? &*entry->index : nullptr;
}

std::span<const std::byte> CollisionIndex::Bytes(uint64_t tile) const {
  const Entry* entry = Checked(tile);
  if (entry == nullptr || !entry->index) return {};
  return TileIndexIn(*entry->value);
}

TileState CollisionIndex::State(uint64_t tile) const {
  const Entry* entry = Checked(tile);
  return entry == nullptr ? TileState::kNoRecords : entry->state;
}

absl::StatusOr<uint64_t> CollisionIndex::CheckAgain(uint64_t tile) const {
  const Entry* entry = Checked(tile);
  if (entry == nullptr || entry->state != TileState::kFresh) return 0;
  std::string value;
  if (file_->Read(*entry->value, value) && TileValueHolds(tile, value) &&
      TileHeaderIn(value)->digest == entry->digest) {
    return value.size();
  }
  return absl::DataLossError(absl::StrCat("the file of the database '",
                                          snapshot_->impl_->state->path,
                                          "' has changed since it was loaded: the collision index "
                                          "of tile ",
                                          tile, " fails its checksum"));
}

std::vector<uint64_t> CollisionIndex::Tiles() const {
  std::vector<uint64_t> tiles;
  for (const auto& [tile, entry] : tiles_) tiles.push_back(tile);
  return tiles;
}

CollisionIndexSummary CollisionIndex::Summary() const {
  CollisionIndexSummary summary;
  for (const auto& [tile, entry] : tiles_) {
    ++summary.tiles;
    summary.bytes += entry->bytes;
    switch (State(tile)) {
      case TileState::kFresh:
        ++summary.fresh;
        summary.unreadable += entry->header->unreadable;
        break;
      case TileState::kStale:
        ++summary.stale;
        break;
      case TileState::kDamaged:
        ++summary.damaged;
        break;
      case TileState::kMissing:
      case TileState::kNoRecords:
        ++summary.missing;
        break;
    }
  }
  return summary;
}

}  // namespace silhouette
