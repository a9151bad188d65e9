// SPDX-License-Identifier: Apache-2.0
// Clearances of all configurations of a tile at once, in levels: which of the free ones have more.
//
// Planes that decide are grown by the level; whose robot image touches them in enough views has no
// more clearance, all others do, and the collision index says which are which. With lines in the
// intersection images no plane decides, but two lookups bound the answer as those of SpaceChecker
// do, of planes that are grown by the level instead of robot images; only configurations in between
// are measured singly.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "db/index/pixel_tree.h"
#include "db/index/place_set.h"
#include "db/index/tile_index.h"
#include "server/collision/clearance.h"
#include "server/collision/space_checker.h"

namespace silhouette {

// Throws std::invalid_argument unless there are levels, ascending, each finite and 0 or more.
void RequireLevels(std::span<const double> levels);

// Refers to the meter, which must outlive it. Used by any number of threads.
class LevelChecker {
 public:
  // `levels`: in pixels. `trees`: those of the index, one per view; empty if there is none. Throws
  // std::invalid_argument as RequireLevels does.
  LevelChecker(const ClearanceMeter& meter, std::span<const double> levels,
               std::span<const PixelTree> trees = {});

  // Per level those of the configurations `free` whose clearance, as the meter measures it, is
  // greater. `free`: configurations of the tile that CollisionChecker finds free. `index`: that of
  // the tile, made of robot images that are those of the test's table; null if it has none: then
  // all are measured singly.
  std::vector<PlaceSet> Above(uint64_t tile, const TileIndex* index, const PlaceSet& free) const {
    return *Above(tile, index, free, nullptr);
  }
  // Nothing: it was given up.
  std::optional<std::vector<PlaceSet>> Above(uint64_t tile, const TileIndex* index,
                                             const PlaceSet& free, const Stop& stop) const;

 private:
  struct Level {
    // A robot image that touches one of these has no more clearance ...
    std::vector<PlaneVotes> reached;
    // ... and perhaps who touches all of these, if there are any; everybody else has.
    std::vector<PlaneVotes> perhaps;
  };

  void AddDecidingPlanes(std::span<const PixelTree> trees);
  void AddParts(std::span<const PixelTree> trees);
  void BoundLines(std::span<const PixelTree> trees);
  // False: it was given up.
  bool MeasureSingly(uint64_t tile, const PlaceSet& places, const Stop& stop,
                     std::vector<PlaceSet>& above) const;

  const ClearanceMeter& meter_;
  std::vector<uint32_t> squared_;  // of each level, the greatest squared clearance not above it
  std::vector<Level> levels_;      // empty without an index
};

}  // namespace silhouette
