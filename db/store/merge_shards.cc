// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/raw_records.h"
#include "db/store/shards.h"
#include "db/store/tile_value.h"
#include "db/store/writer_lock.h"

namespace silhouette {
namespace {

constexpr size_t kBytesPerMerge = size_t{32} << 20;  // in one transaction

// Entries of `meta` that each database has for itself, or that are compared otherwise.
bool IsOwn(std::string_view key) {
  static const std::set<std::string_view> own = {schema::kFormatKey, schema::kCellKey,
                                                 schema::kProvenanceKey, schema::kVariantsKey,
                                                 schema::kGenerationKey};
  return own.contains(key) || key.starts_with(schema::kDrawnKey) ||
         key.starts_with(schema::kCaptureKey);
}

const std::string& VariantName(const VariantState& variant) { return variant.database->variant(); }

// Gives a finished folder its name, for good.
absl::Status MoveInto(const std::string& folder, const std::string& into) {
  std::error_code error;
  std::filesystem::rename(folder, into, error);
  if (error) {
    return FailedPrecondition("'", folder, "' cannot be renamed to '", into,
                              "': ", error.message());
  }
  const std::filesystem::path above = std::filesystem::absolute(into).parent_path();
  const int file = open(above.c_str(), O_RDONLY | O_CLOEXEC);
  if (file >= 0) {
    fsync(file);
    close(file);
  }
  return absl::OkStatus();
}

}  // namespace

class ShardMerge {
 public:
  static absl::StatusOr<MergeReport> Run(const std::vector<std::string>& paths,
                                         const std::string& into, const MergeSettings& settings);

 private:
  struct Shard {
    std::string path;
    std::unique_ptr<Database> database;
    std::vector<VariantState> variants;  // the default one, then the others by name
    storage::v1::DrawnImages drawn;      // of one of the variants
    std::map<std::string, storage::v1::DrawnImages> drawn_by_variant;
    std::map<std::string, std::string> shared;  // of `meta`
  };
  // What lies at a key of a sub-database.
  using Entries = std::vector<std::pair<std::string, std::string>>;
  struct Batch {
    Entries records;
    Entries tiles;
    size_t bytes = 0;
  };

  explicit ShardMerge(const MergeSettings& settings) : settings_(settings) {}

  absl::Status OpenShards(const std::vector<std::string>& paths);
  static absl::StatusOr<Shard> OpenShard(const std::string& path);
  absl::Status CheckSame(const Shard& shard) const;
  absl::Status CheckNumbers() const;
  absl::Status MergeInto(Database& target);
  absl::Status MergeVariant(size_t variant, Database& target);
  absl::Status ReadTile(const Shard& shard, size_t variant, uint64_t tile, Batch& batch);
  absl::Status Write(const Database& target, MDB_dbi index, Batch& batch);
  absl::Status WriteShared(const Database& target);
  absl::Status CheckNothingElse(const Shard& shard, size_t variant, uint64_t records) const;

  static std::string Named(const Shard& shard) {
    return absl::StrCat("shard ", NameOfShard(shard.drawn), " ('", shard.path, "')");
  }

  const MergeSettings& settings_;
  std::vector<Shard> shards_;  // by number, once checked
  MergeReport report_;
  uint64_t done_ = 0;  // tiles
};

absl::StatusOr<ShardMerge::Shard> ShardMerge::OpenShard(const std::string& path) {
  Shard shard;
  shard.path = path;
  ASSIGN_OR_RETURN(shard.database, Database::Open(path, Database::Access::kRead));
  ASSIGN_OR_RETURN(shard.variants, shard.database->ReadVariants());
  std::ranges::sort(shard.variants.begin() + 1, shard.variants.end(), {}, VariantName);
  for (const VariantState& variant : shard.variants) {
    ASSIGN_OR_RETURN(const auto drawn, variant.snapshot.DrawnImages());
    if (drawn) shard.drawn_by_variant[variant.database->variant()] = *drawn;
  }
  if (shard.drawn_by_variant.empty()) {
    return FailedPrecondition("'", path,
                              "' has no drawn robot images; merge takes what 'silhouette-capture "
                              "draw --shard' makes");
  }
  shard.drawn = shard.drawn_by_variant.begin()->second;
  const Snapshot::Impl& state = *shard.variants.front().snapshot.impl_;
  const auto hold = state.environment().HoldMap();
  RETURN_IF_ERROR(
      state.environment().ForEachEntry(state.transaction(), state.environment().meta(), "",
                                       [&](std::string_view key, std::string_view value) {
                                         if (!IsOwn(key))
                                           shard.shared[std::string(key)] = std::string(value);
                                         return true;
                                       }));
  for (const auto& [key, value] : shard.shared) {
    if (!schema::IsSealed(value)) return DamagedMeta(state.environment(), key);
  }
  return shard;
}

// With the first one.
absl::Status ShardMerge::CheckSame(const Shard& shard) const {
  const Shard& first = shards_.front();
  const std::string both = absl::StrCat("'", first.path, "' and '", shard.path, "'");
  const auto& cell = first.database->cell();
  if (cell.SerializeAsString() != shard.database->cell().SerializeAsString()) {
    const std::vector<std::string> differences =
        Differences(cell, "the first", shard.database->cell(), "the second");
    return FailedPrecondition(both, " are of different cells: ", absl::StrJoin(differences, "; "));
  }
  for (const auto& [variant, drawn] : first.drawn_by_variant) {
    const auto other = shard.drawn_by_variant.find(variant);
    const std::string difference = other == shard.drawn_by_variant.end()
                                       ? absl::StrCat("other variants (no '", variant, "')")
                                       : DrawnDifference(drawn, other->second);
    if (difference.empty()) continue;
    return FailedPrecondition(both, " do not belong together: they were drawn from ", difference);
  }
  if (first.drawn_by_variant.size() != shard.drawn_by_variant.size() ||
      !std::ranges::equal(first.variants, shard.variants, {}, VariantName, VariantName)) {
    return FailedPrecondition(both, " have different variants");
  }
  std::set<std::string> keys;
  for (const auto* values : {&first.shared, &shard.shared}) {
    for (const auto& [key, value] : *values) keys.insert(key);
  }
  for (const std::string& key : keys) {
    const auto a = first.shared.find(key);
    const auto b = shard.shared.find(key);
    if (a != first.shared.end() && b != shard.shared.end() && a->second == b->second) continue;
    return FailedPrecondition(both, " do not belong together: their entries '", key, "' differ");
  }
  return absl::OkStatus();
}

// That each shard is there once.
absl::Status ShardMerge::CheckNumbers() const {
  const uint64_t count = shards_.front().drawn.shards();
  std::map<uint64_t, const Shard*> by_number;
  for (const Shard& shard : shards_) {
    for (const auto& [variant, drawn] : shard.drawn_by_variant) {
      if (drawn.shards() == count && drawn.shard() == shard.drawn.shard()) continue;
      return FailedPrecondition("'", shard.path, "' is shard ", NameOfShard(drawn), ", and '",
                                shards_.front().path, "' is one of ", count);
    }
    const auto [other, is_new] = by_number.emplace(shard.drawn.shard(), &shard);
    if (is_new) continue;
    return FailedPrecondition("'", other->second->path, "' and '", shard.path, "' are both shard ",
                              NameOfShard(shard.drawn), "; name each shard once");
  }
  std::vector<uint64_t> missing;
  for (uint64_t number = 0; number < count; ++number) {
    if (!by_number.contains(number)) missing.push_back(number);
  }
  if (missing.empty()) return absl::OkStatus();
  return FailedPrecondition("of ", count, " shards ", absl::StrJoin(missing, ", "),
                            missing.size() == 1 ? " is" : " are",
                            " missing, and so are their tiles; draw them first");
}

absl::Status ShardMerge::OpenShards(const std::vector<std::string>& paths) {
  if (paths.empty()) return absl::InvalidArgumentError("name the shards");
  for (const std::string& path : paths) {
    ASSIGN_OR_RETURN(Shard shard, OpenShard(path));
    shards_.push_back(std::move(shard));
    RETURN_IF_ERROR(CheckSame(shards_.back()));
  }
  RETURN_IF_ERROR(CheckNumbers());
  std::ranges::sort(shards_, {}, [](const Shard& shard) { return shard.drawn.shard(); });
  report_.shards = shards_.size();
  report_.tiles =
      shards_.front().database->grid().tiles() * shards_.front().drawn_by_variant.size();
  return absl::OkStatus();
}

// Adds the records and the index of a tile, as they are stored.
absl::Status ShardMerge::ReadTile(const Shard& shard, size_t variant, uint64_t tile, Batch& batch) {
  const Snapshot::Impl& state = *shard.variants[variant].snapshot.impl_;
  const auto damaged = [&](const std::string& what) {
    return absl::DataLossError(absl::StrCat(Named(shard), ": ", what, " of tile ", tile,
                                            " is damaged; draw the shard again"));
  };
  RecordDigest digest;
  uint64_t records = 0;
  RETURN_IF_ERROR(ForEachRecord(state.records(), KeysOfTile(tile), [&](const RawRecord& record) {
    const auto number = schema::DecodeKey(record.key);
    if (!number || !state.state->grid.Contains(*number) ||
        !schema::IsSealed(record.value, *number)) {
      return damaged("a record");
    }
    digest.Add(record.key, record.value);
    batch.bytes += record.value.size();
    batch.records.emplace_back(record.key, record.value);
    ++records;
    return absl::OkStatus();
  }));
  const uint64_t expected = ConfigurationsIn(state.state->grid, tile);
  if (records != expected) {
    return FailedPrecondition(Named(shard), " lacks ", expected - records, " of the ", expected,
                              " configurations of tile ", tile, "; go on drawing it");
  }
  report_.records += records;
  ASSIGN_OR_RETURN(const auto index, state.environment().Find(state.state->places.collision_index));
  const auto hold = state.environment().HoldMap();
  std::optional<std::string_view> value;
  if (index) {
    ASSIGN_OR_RETURN(value,
                     state.environment().Get(state.transaction(), *index, schema::EncodeKey(tile)));
  }
  const std::optional<TileHeader> header = value ? TileHeaderIn(*value) : std::nullopt;
  if (!header || header->digest != digest.Get() || header->unreadable != 0 || header->coding != 0) {
    return FailedPrecondition(Named(shard), " has no collision index of tile ", tile,
                              " that fits its records; go on drawing it");
  }
  if (!TileValueHolds(tile, *value)) return damaged("the collision index");
  batch.bytes += value->size();
  batch.tiles.emplace_back(schema::EncodeKey(tile), *value);
  return absl::OkStatus();
}

absl::Status ShardMerge::Write(const Database& target, MDB_dbi index, Batch& batch) {
  const DatabaseState& state = *target.state_;
  const auto write = [&](WriteTransaction& transaction) -> absl::Status {
    for (const auto& [key, value] : batch.records) {
      RETURN_IF_ERROR(transaction.Put(state.robot_images, key, value, MDB_APPEND));
    }
    for (const auto& [key, value] : batch.tiles) {
      RETURN_IF_ERROR(transaction.Put(index, key, value, MDB_APPEND));
    }
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(state.environment->Update(batch.bytes, write));
  report_.bytes += batch.bytes;
  done_ += batch.tiles.size();
  batch = {};
  if (settings_.progress && !settings_.progress(done_, report_.tiles)) {
    return absl::CancelledError("the merge was stopped; nothing was stored");
  }
  return absl::OkStatus();
}

// That a shard has no more records than those of its tiles.
absl::Status ShardMerge::CheckNothingElse(const Shard& shard, size_t variant,
                                          uint64_t records) const {
  const uint64_t all = shard.variants[variant].snapshot.size();
  if (all == records) return absl::OkStatus();
  return FailedPrecondition(
      Named(shard), " overlaps others: it has ", all - records,
      " records of tiles that are not its own; draw it again into a new database");
}

absl::Status ShardMerge::MergeVariant(size_t variant, Database& target) {
  ASSIGN_OR_RETURN(const MDB_dbi index,
                   target.state_->environment->Make(target.state_->places.collision_index));
  std::vector<uint64_t> records(shards_.size());
  Batch batch;
  for (uint64_t tile = 0; tile < target.grid().tiles(); ++tile) {
    const size_t shard = tile % shards_.size();
    const uint64_t before = report_.records;
    RETURN_IF_ERROR(ReadTile(shards_[shard], variant, tile, batch));
    records[shard] += report_.records - before;
    if (batch.bytes >= kBytesPerMerge) RETURN_IF_ERROR(Write(target, index, batch));
  }
  RETURN_IF_ERROR(Write(target, index, batch));
  for (size_t i = 0; i < shards_.size(); ++i) {
    RETURN_IF_ERROR(CheckNothingElse(shards_[i], variant, records[i]));
  }
  return absl::OkStatus();
}

// What is not of a shard alone, and who wrote all this.
absl::Status ShardMerge::WriteShared(const Database& target) {
  const DatabaseState& state = *target.state_;
  const Shard& first = shards_.front();
  const auto entry = NewProvenance(absl::Now(), settings_.program, report_.records);
  return WriteChange(state, 0, entry, [&](WriteTransaction& transaction) -> absl::Status {
    for (const auto& [key, value] : first.shared) {
      RETURN_IF_ERROR(transaction.Put(state.environment->meta(), key, value));
    }
    for (const auto& [variant, drawn] : first.drawn_by_variant) {
      storage::v1::DrawnImages whole = drawn;
      whole.set_shard(0);
      whole.set_shards(1);
      RETURN_IF_ERROR(WriteMeta(*state.environment, transaction,
                                schema::PlacesOfVariant(variant).drawn_key,
                                whole.SerializeAsString()));
    }
    return absl::OkStatus();
  });
}

absl::Status ShardMerge::MergeInto(Database& target) {
  const std::vector<VariantState>& variants = shards_.front().variants;
  for (size_t i = 0; i < variants.size(); ++i) {
    const std::string& name = variants[i].database->variant();
    if (i > 0) RETURN_IF_ERROR(target.CreateVariant(name, settings_.program).status());
    if (!shards_.front().drawn_by_variant.contains(name)) {
      for (const Shard& shard : shards_) RETURN_IF_ERROR(CheckNothingElse(shard, i, 0));
      continue;
    }
    ASSIGN_OR_RETURN(const auto variant, target.OpenVariant(name));
    RETURN_IF_ERROR(MergeVariant(i, *variant));
  }
  return WriteShared(target);
}

absl::StatusOr<MergeReport> ShardMerge::Run(const std::vector<std::string>& paths,
                                            const std::string& into,
                                            const MergeSettings& settings) {
  std::string target = into;
  while (target.size() > 1 && target.back() == '/') target.pop_back();
  if (std::filesystem::exists(target)) {
    return absl::AlreadyExistsError(
        absl::StrCat("there is something in '", target, "' already; name a new folder"));
  }
  ShardMerge merge(settings);
  RETURN_IF_ERROR(merge.OpenShards(paths));
  const std::string part = target + ".part";
  std::optional<WriterLock> no_other_merge;  // until the new database has a lock of its own
  if (std::filesystem::exists(part)) {
    ASSIGN_OR_RETURN(WriterLock taken, WriterLock::Take(part));
    no_other_merge.emplace(std::move(taken));
    RemoveDatabase(part);
  }
  ASSIGN_OR_RETURN(const std::unique_ptr<Database> made,
                   Database::Create(part, merge.shards_.front().database->cell()));
  absl::Cleanup remove = [&] { RemoveDatabase(part); };
  RETURN_IF_ERROR(merge.MergeInto(*made));
  std::move(remove).Cancel();
  RETURN_IF_ERROR(MoveInto(part, target));
  return merge.report_;
}

absl::StatusOr<MergeReport> MergeShards(const std::vector<std::string>& shards,
                                        const std::string& into, const MergeSettings& settings) {
  return ShardMerge::Run(shards, into, settings);
}

}  // namespace silhouette
