// SPDX-License-Identifier: Apache-2.0
// The free cells of the whole grid (cell_checker.h), for one scene and one policy.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "db/index/place_set.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/cell_checker.h"
#include "server/collision/stop.h"

namespace silhouette {

// One step along a joint, for sets of configurations of a tile. Part of the pure core.
// Used by any number of threads.
class JointStep {
 public:
  // Along joint `joint` of the grid.
  JointStep(const ConfigurationGrid& grid, int joint);

  // How many tiles the grid has along the joint, and how far apart the numbers of two neighbouring
  // ones are.
  uint64_t tiles() const { return tiles_; }
  uint64_t stride() const { return stride_; }
  // Which of these a tile is.
  uint64_t PlaceOf(uint64_t tile) const { return tile / stride_ % tiles_; }
  bool wraps() const { return wraps_; }

  // Adds to `set` every configuration of its tile, the `at`th along the joint, for which the one a
  // step further is in `set`, or in `next`, the set of the tile after it. The last value of a
  // joint that wraps is followed by the first: `next` of the last tile is that of the first one.
  // That of a joint that does not wrap is followed by nothing: `next` is not looked at then. Of
  // places beyond the grid's rim nothing is stated. `next` is another object than `set`, unless it
  // is not looked at. Never allocates.
  void AddPlacesBefore(uint64_t at, const PlaceSet& next, PlaceSet& set) const;

 private:
  // What comes from where.
  struct Way {
    PlaceSet within;  // places that are followed by one of the same tile,
    bool some_within = false;
    PlaceSet across;  // and by one of the next, as seen from the place before
    bool some_across = false;
    uint64_t back = 0;
  };
  Way WayWhere(uint64_t last, bool goes_on) const;

  uint64_t tiles_ = 1;
  uint64_t stride_ = 1;
  bool wraps_ = false;
  uint64_t edge_ = 1;
  uint64_t step_ = 1;  // difference of places a step apart
  Way inner_;          // all tiles but the last one
  Way last_;
};

// Works in slabs: what the grid's tiles of one value have, along the first joint that has several.
// Takes, besides its result, the sets of two of them, and less when it is done. Refers to the test,
// which must outlive it. Used by any number of threads.
class FreeCells {
 public:
  // The index of a tile, as CellChecker::LookUp takes it.
  using IndexOf = std::function<const TileIndex*(uint64_t tile)>;

  FreeCells(const SpaceChecker& test, IndexOf index_of);

  // Works these tiles out, and more of their slabs. Looks now and again whether it is to stop; then
  // it is false if any is left, and another call goes on from there. Threads that come meanwhile
  // help it along.
  bool WorkOut(std::span<const uint64_t> tiles, const Stop& stop);

  bool ready(uint64_t tile) const { return ready_[tile].load(std::memory_order_acquire); }
  // Of a tile that is ready: the cells that begin at its configurations.
  const PlaceSet& tile(uint64_t tile) const { return tiles_[tile]; }

  // As CellChecker's, of the tiles that are ready: images that could not be read prove nothing.
  bool exact() const { return test_.exact() && all_read_.load(std::memory_order_acquire); }

 private:
  static constexpr uint64_t kNone = ~uint64_t{0};
  struct Slab {
    uint64_t number = kNone;
    std::vector<PlaceSet> sets;      // of one tile after another
    std::vector<uint8_t> something;  // whether each of these is not empty
    uint64_t looked_up = 0;          // tiles
    int spread = 0;                  // joints
  };

  // A part of the work on the slab that is worked on, or on `slab` if none is.
  void Step(uint64_t slab);
  // Finds out which tiles have a configuration that is the corner of a cell that may be occupied.
  // False as long as it is not done.
  bool Surveyed();
  Slab& Hold(uint64_t number, uint64_t other);
  // Whether the slab's sets are those of the corners along all joints but the one across slabs;
  // else does a part of it.
  bool Prepared(Slab& slab);
  void Spread(Slab& slab, const JointStep& joint);
  // The tile of `slab` that is the `at`th there; `next`: the slab behind it.
  void Finish(const Slab& slab, const Slab& next, uint64_t at);

  const CellChecker test_;
  const IndexOf index_of_;
  std::vector<JointStep> joints_;
  size_t across_ = 0;  // of these
  uint64_t slab_tiles_ = 1;
  std::vector<PlaceSet> tiles_;
  std::unique_ptr<std::atomic<bool>[]> ready_;
  std::atomic<bool> all_read_ = true;

  std::mutex mutex_;  // of what follows
  uint64_t working_ = kNone;
  uint64_t finished_ = 0;  // tiles of it
  uint64_t left_ = 0;      // slabs
  // Per tile, what there may be in it, and in the tiles behind it; whether it is needed for that.
  std::vector<uint64_t> may_touch_;
  std::vector<uint8_t> needed_;
  std::array<Slab, 2> slabs_;
  std::vector<PlaceSet> scratch_;
};

}  // namespace silhouette
