// SPDX-License-Identifier: Apache-2.0
// Building the collision index: threads that build a tile each, and the caller's, which writes.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/collision_index.h"
#include "db/store/database_state.h"
#include "db/store/raw_records.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"
#include "db/store/tile_value.h"

namespace silhouette {
namespace {

constexpr size_t kLargestValue = std::numeric_limits<uint32_t>::max();

// What became of a tile.
struct Outcome {
  uint64_t tile = 0;
  enum { kFresh, kBuilt, kRemoved } kind = kFresh;
  std::string value;  // if built
  uint64_t robot_images = 0;
  uint64_t unreadable = 0;
};

}  // namespace

class IndexBuild {
 public:
  static absl::StatusOr<IndexBuildReport> Run(Database& database, const IndexBuildOptions& options);

 private:
  IndexBuild(const DatabaseState& state, const IndexBuildOptions& options, MDB_dbi collision_index)
      : state_(state),
        environment_(*state.environment),
        options_(options),
        collision_index_(collision_index) {
    for (const MaskSize size : state.mask_sizes) {
      trees_.emplace_back(size);
      mask_bytes_ += size.bytes();
    }
  }

  absl::Status FindTiles();
  void BuildTiles();
  absl::StatusOr<Outcome> TreatTile(uint64_t tile, MDB_txn* transaction,
                                    TileIndexBuilder& builder) const;
  bool IsFresh(uint64_t tile, MDB_txn* transaction, const std::optional<uint64_t>& digest) const;
  bool LiesInFile(std::string_view shown) const;
  absl::StatusOr<Outcome> BuildTile(uint64_t tile, MDB_txn* transaction,
                                    TileIndexBuilder& builder) const;
  std::optional<uint64_t> TakeTile();
  bool Deliver(absl::StatusOr<Outcome> outcome);
  void Stop();
  absl::Status Build(IndexBuildReport& report);
  absl::Status WriteTiles(IndexBuildReport& report);
  absl::Status Write(const std::vector<Outcome>& outcomes);

  const DatabaseState& state_;
  Environment& environment_;
  const IndexBuildOptions& options_;
  const MDB_dbi collision_index_;
  std::vector<PixelTree> trees_;
  size_t mask_bytes_ = 0;
  size_t page_size_ = 0;
  std::vector<uint64_t> tiles_;
  bool stopped_early_ = false;  // by the progress callback

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by the mutex.
  size_t next_ = 0;
  bool stopped_ = false;
  size_t building_ = 0;  // threads that may still deliver
  std::vector<Outcome> finished_;
  size_t finished_bytes_ = 0;
  absl::Status status_;
};

// The tiles that have records or an index.
absl::Status IndexBuild::FindTiles() {
  ASSIGN_OR_RETURN(ReadTransaction transaction, environment_.Read());
  std::set<uint64_t> tiles;
  const uint64_t limit = state_.grid.tiles();
  for (uint64_t tile = 0; tile < limit; ++tile) {
    ASSIGN_OR_RETURN(const auto next, NextTileWithRecords({state_, transaction.get()}, tile));
    if (!next || *next >= limit) break;
    tile = *next;
    tiles.insert(tile);
  }
  const auto hold = environment_.HoldMap();
  page_size_ = environment_.PageSize();
  RETURN_IF_ERROR(environment_.ForEachEntry(transaction.get(), collision_index_, "",
                                            [&](std::string_view key, std::string_view) {
                                              const auto tile = schema::DecodeKey(key);
                                              if (tile && *tile < limit) tiles.insert(*tile);
                                              return true;
                                            }));
  tiles_.assign(tiles.begin(), tiles.end());
  return absl::OkStatus();
}

// Nothing: there is no more to do.
std::optional<uint64_t> IndexBuild::TakeTile() {
  const std::lock_guard lock(mutex_);
  if (stopped_ || next_ == tiles_.size()) return std::nullopt;
  return tiles_[next_++];
}

// Waits while too much waits already. Returns whether to go on.
bool IndexBuild::Deliver(absl::StatusOr<Outcome> outcome) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock,
                [&] { return stopped_ || finished_.empty() || finished_bytes_ < options_.buffer; });
  if (!outcome.ok()) {
    status_.Update(outcome.status());
    stopped_ = true;
  } else {
    finished_bytes_ += outcome->value.size();
    finished_.push_back(*std::move(outcome));
  }
  changed_.notify_all();
  return !stopped_;
}

void IndexBuild::Stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
}

// The work of a thread.
void IndexBuild::BuildTiles() {
  absl::StatusOr<ReadTransaction> transaction = environment_.Read();
  if (!transaction.ok()) {
    Deliver(transaction.status());
    return;
  }
  transaction->Reset();
  TileIndexBuilder builder(trees_);
  while (const std::optional<uint64_t> tile = TakeTile()) {
    // One state per tile, and none while waiting: then pages can be used again.
    if (absl::Status status = transaction->Renew(); !status.ok()) {
      Deliver(std::move(status));
      return;
    }
    absl::StatusOr<Outcome> outcome = TreatTile(*tile, transaction->get(), builder);
    transaction->Reset();
    if (!Deliver(std::move(outcome))) return;
  }
}

absl::StatusOr<Outcome> IndexBuild::TreatTile(uint64_t tile, MDB_txn* transaction,
                                              TileIndexBuilder& builder) const {
  Outcome outcome;
  outcome.tile = tile;
  ASSIGN_OR_RETURN(const std::optional<uint64_t> digest, DigestOfTile({state_, transaction}, tile));
  if (!digest) {
    outcome.kind = Outcome::kRemoved;
    return outcome;
  }
  if (!options_.all && IsFresh(tile, transaction, digest)) return outcome;
  return BuildTile(tile, transaction, builder);
}

bool IndexBuild::IsFresh(uint64_t tile, MDB_txn* transaction,
                         const std::optional<uint64_t>& digest) const {
  const auto hold = environment_.HoldMap();
  const auto found = environment_.Get(transaction, collision_index_, schema::EncodeKey(tile));
  if (!found.ok() || !*found) return false;
  const std::string_view value = **found;
  const std::optional<TileHeader> header = TileHeaderIn(value);
  return header && header->digest == digest && header->unreadable == 0 && header->coding == 0 &&
         TileValueHolds(tile, value) && LiesInFile(value);
}

// Whether readers, who look into the file, find a value there that LMDB shows.
bool IndexBuild::LiesInFile(std::string_view shown) const {
  const std::optional<uint64_t> offset = OffsetInFile(shown, page_size_);
  mdb_filehandle_t file = -1;
  std::array<char, kTileValueHeader> header;
  return offset && mdb_env_get_fd(environment_.get(), &file) == 0 &&
         pread(file, header.data(), header.size(), static_cast<off_t>(*offset)) ==
             static_cast<ssize_t>(header.size()) &&
         shown.substr(0, header.size()) == std::string_view(header.data(), header.size());
}

absl::StatusOr<Outcome> IndexBuild::BuildTile(uint64_t tile, MDB_txn* transaction,
                                              TileIndexBuilder& builder) const {
  Outcome outcome;
  outcome.tile = tile;
  outcome.kind = Outcome::kBuilt;
  RecordDigest digest;
  std::vector<MaskWords> images(trees_.size());
  const auto add = [&](const RawRecord& record) {
    const std::optional<ConfigurationNumber> number = schema::DecodeKey(record.key);
    if (!number) return absl::OkStatus();
    digest.Add(record.key, record.value);
    if (!state_.grid.Contains(*number)) return absl::OkStatus();
    const absl::StatusOr<RobotImage> image =
        DecodeRobotImage(*number, record.value, state_.mask_sizes, record.base);
    if (!image.ok()) ++outcome.unreadable;
    if (!image.ok() || image->excluded) return absl::OkStatus();
    for (size_t view = 0; view < images.size(); ++view) images[view] = image->masks[view].words();
    builder.Add(*number % kTileSize, images);
    ++outcome.robot_images;
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(ForEachRecord({state_, transaction}, KeysOfTile(tile), add));
  const TileHeader header{.digest = digest.Get(), .unreadable = outcome.unreadable};
  outcome.value = EncodeTileValue(tile, header, builder.Finish(), page_size_);
  if (outcome.value.size() > kLargestValue) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the collision index of tile ", tile,
                     " is too large to be stored; the masks have too many pixels"));
  }
  return outcome;
}

absl::Status IndexBuild::Write(const std::vector<Outcome>& outcomes) {
  size_t bytes = 0;
  for (const Outcome& outcome : outcomes) bytes += outcome.value.size();
  if (std::ranges::all_of(outcomes, [](const Outcome& o) { return o.kind == Outcome::kFresh; })) {
    return absl::OkStatus();
  }
  return environment_.Update(bytes, [&](WriteTransaction& transaction) {
    for (const Outcome& outcome : outcomes) {
      if (outcome.kind == Outcome::kFresh) continue;
      const schema::NumberKey key = schema::EncodeKey(outcome.tile);
      RETURN_IF_ERROR(outcome.kind == Outcome::kBuilt
                          ? transaction.Put(collision_index_, key, outcome.value)
                          : transaction.Delete(collision_index_, key));
    }
    return absl::OkStatus();
  });
}

// Writes what is finished, all of it at a time, until the threads have ended.
absl::Status IndexBuild::WriteTiles(IndexBuildReport& report) {
  for (;;) {
    std::vector<Outcome> outcomes;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return !finished_.empty() || building_ == 0; });
      if (finished_.empty()) return status_;
      outcomes.swap(finished_);
      finished_bytes_ = 0;
    }
    changed_.notify_all();
    RETURN_IF_ERROR(Write(outcomes));
    for (const Outcome& outcome : outcomes) {
      ++report.done;
      report.removed += outcome.kind == Outcome::kRemoved ? 1 : 0;
      if (outcome.kind != Outcome::kBuilt) continue;
      ++report.built;
      report.robot_images += outcome.robot_images;
      report.unreadable += outcome.unreadable;
      report.bytes += outcome.value.size();
      report.mask_bytes += outcome.robot_images * mask_bytes_;
    }
    if (options_.progress && !options_.progress(report.done, report.tiles)) {
      stopped_early_ = true;
      Stop();
    }
  }
}

absl::Status IndexBuild::Build(IndexBuildReport& report) {
  std::vector<std::jthread> threads;
  building_ = static_cast<size_t>(std::max(options_.threads, 1));
  for (size_t i = building_; i > 0; --i) {
    threads.emplace_back([this] {
      BuildTiles();
      const std::lock_guard lock(mutex_);
      --building_;
      changed_.notify_all();
    });
  }
  // Before the threads are waited for, whatever happens.
  const absl::Cleanup stop = [this] { Stop(); };
  return WriteTiles(report);
}

absl::StatusOr<IndexBuildReport> IndexBuild::Run(Database& database,
                                                 const IndexBuildOptions& options) {
  RETURN_IF_ERROR(CheckWritable(*database.state_));
  std::vector<std::string> names = {database.variant()};
  if (database.state_->places.is_default() && !options.only_variant) {
    ASSIGN_OR_RETURN(std::vector<std::string> all, database.Variants());
    names = std::move(all);
  }
  std::vector<std::unique_ptr<Database>> variants;
  std::vector<std::unique_ptr<IndexBuild>> builds;
  IndexBuildReport report;
  for (const std::string& name : names) {
    ASSIGN_OR_RETURN(std::unique_ptr<Database> variant, database.OpenVariant(name));
    const DatabaseState& state = *variant->state_;
    ASSIGN_OR_RETURN(const auto collision_index,
                     state.environment->Make(state.places.collision_index));
    variants.push_back(std::move(variant));
    builds.emplace_back(new IndexBuild(state, options, collision_index));
    RETURN_IF_ERROR(builds.back()->FindTiles());
    report.tiles += builds.back()->tiles_.size();
  }
  bool stopped = options.progress && !options.progress(0, report.tiles);
  for (const std::unique_ptr<IndexBuild>& build : builds) {
    if (stopped) break;
    RETURN_IF_ERROR(build->Build(report));
    stopped = build->stopped_early_;
  }
  report.stopped = report.done < report.tiles;
  return report;
}

absl::StatusOr<IndexBuildReport> BuildCollisionIndex(Database& database,
                                                     const IndexBuildOptions& options) {
  return IndexBuild::Run(database, options);
}

}  // namespace silhouette
