// SPDX-License-Identifier: Apache-2.0
// The collision index of a database: reading it, and building it.
//
// It holds the robot images transposed, tile by tile (db/index/tile_index.h). Every tile carries a
// digest of the records that it was built from. A tile whose records have changed since, by
// whatever program, is stale.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "db/index/pixel_tree.h"
#include "db/index/tile_index.h"
#include "db/store/store.h"

namespace silhouette {

// What there is of a tile. Only kFresh can be used.
enum class TileState {
  kMissing,    // it has records, but no index
  kStale,      // its index was built from other records, or in the form of an earlier program
  kDamaged,    // its index fails its checksum, or makes no sense
  kNoRecords,  // there is nothing of it
  kFresh,
};

struct CollisionIndexSummary {
  // Tiles that have records or an index, and how many of them are in which state.
  uint64_t tiles = 0;
  uint64_t fresh = 0;
  uint64_t stale = 0;
  uint64_t missing = 0;
  uint64_t damaged = 0;
  // Records that could not be read when the fresh tiles were built: the index does not have them.
  uint64_t unreadable = 0;
  // Size of the index, those of its tiles included that cannot be used.
  uint64_t bytes = 0;
};

// The index in one state of the database, for any number of threads. It is not copied: it is read
// where it lies in the file, through a map of its own. LMDB's map may grow meanwhile, in this
// process and in others.
//
// It keeps its snapshot alive, so pages of that state are not reused. If a capture writes
// meanwhile, the file grows: by the pages that each commit rewrites (some 8 of 4 KiB) and by the
// tiles of an index that is built then. Pages are reused once this is destroyed.
class CollisionIndex {
 public:
  // Takes the state of `snapshot`. Reads the head of every tile and of every record: some 0.1 s per
  // million records, once the file is in memory. A database without an index is no error.
  static absl::StatusOr<std::shared_ptr<const CollisionIndex>> Open(Snapshot snapshot);
  // The same of a snapshot that others hold as well.
  static absl::StatusOr<std::shared_ptr<const CollisionIndex>> Open(
      std::shared_ptr<const Snapshot> snapshot);
  ~CollisionIndex();
  CollisionIndex(const CollisionIndex&) = delete;
  CollisionIndex& operator=(const CollisionIndex&) = delete;

  // The state: for one thread at a time, as every snapshot.
  const Snapshot& snapshot() const { return *snapshot_; }
  uint64_t generation() const { return snapshot_->generation(); }

  // One per view: those of the indices of all tiles.
  std::span<const PixelTree> trees() const { return trees_; }

  // The index of a tile, in its place in the file; null if it is not fresh. Lives as long as this.
  // The first call for a tile checks its checksum, which reads all of it; others allocate nothing.
  const TileIndex* Tile(uint64_t tile) const;

  // The bytes of Tile(tile), at an address that is a multiple of 64, perhaps followed by zeros;
  // none if it is null.
  std::span<const std::byte> Bytes(uint64_t tile) const;

  // Checks the checksum as Tile() does.
  TileState State(uint64_t tile) const;

  // Reads a fresh tile again, from the file instead of the map, and checks its checksum: the file
  // may have been damaged after Tile() checked it. Returns the bytes read; 0 for a tile that is not
  // fresh. DataLoss names the tile; what Tile() gives is wrong then. For background threads: no
  // other call waits for it.
  absl::StatusOr<uint64_t> CheckAgain(uint64_t tile) const;

  // The tiles that have records or an index, in order.
  std::vector<uint64_t> Tiles() const;

  // Checks the checksums of all tiles.
  CollisionIndexSummary Summary() const;

 private:
  class File;
  struct Entry;

  explicit CollisionIndex(std::shared_ptr<const Snapshot> snapshot);
  absl::Status ReadHeads();
  absl::Status ReadDigests();
  Entry& EntryOf(uint64_t tile);
  const Entry* Checked(uint64_t tile) const;
  void Check(uint64_t tile, const Entry& entry) const;

  const std::shared_ptr<const Snapshot> snapshot_;
  std::vector<PixelTree> trees_;
  std::unique_ptr<const File> file_;
  std::map<uint64_t, std::unique_ptr<Entry>> tiles_;
};

struct IndexBuildOptions {
  // Builds the tiles that are fresh, too.
  bool all = false;
  // Builds this variant alone, even if it is the default one.
  bool only_variant = false;
  int threads = 2;
  // How many bytes of finished tiles may wait to be written (a tile may always); twice as much is
  // being written.
  size_t buffer = size_t{32} << 20;
  // Called on the calling thread, before the first tile and then from time to time, with the number
  // of finished tiles. Returning false stops the build.
  std::function<bool(uint64_t done, uint64_t tiles)> progress = nullptr;
};

struct IndexBuildReport {
  // Tiles that have records or an index, and how many of them are done.
  uint64_t tiles = 0;
  uint64_t done = 0;
  // Of these: built, or removed because they have no records any more. The others were fresh.
  uint64_t built = 0;
  uint64_t removed = 0;
  // Of those built: robot images, records that could not be read, bytes of the index, and bytes
  // that the masks take as they are.
  uint64_t robot_images = 0;
  uint64_t unreadable = 0;
  uint64_t bytes = 0;
  uint64_t mask_bytes = 0;
  bool stopped = false;
};

// Builds the index of every tile of the variant that is not fresh, or was built from records that
// could not be read; of the default variant's database, then of all other variants. Other writers
// of the same Database may go on meanwhile: a tile is built from one state, and is stale if its
// records change. What is committed stays whatever happens afterwards, so it can be stopped and
// begun again. Memory: per thread the index of a tile, and three times the buffer. Needs kWrite.
// The generation stays what it is. ResourceExhausted: the disk is full, or the index of a tile is
// too large to be stored (4 GiB).
absl::StatusOr<IndexBuildReport> BuildCollisionIndex(Database& database,
                                                     const IndexBuildOptions& options = {});

}  // namespace silhouette
