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

#include "server/collision/cell_checker.h"
#include "server/collision/joint_step.h"

namespace silhouette {

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
  bool WorkOut(std::span<const uint64_t> tiles, const std::function<bool()>& stop);

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
