// One step along a joint, for sets of configurations of a tile. Part of the pure core.
#pragma once

#include <cstdint>

#include "db/index/place_set.h"
#include "db/mask/configuration_grid.h"

namespace silhouette {

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
  // places beyond the grid's rim nothing is told. `next` is another object than `set`, unless it is
  // not looked at. Never allocates.
  void AddPlacesBefore(uint64_t at, const PlaceSet& next, PlaceSet& set) const;

 private:
  // What comes from where.
  struct Way {
    PlaceSet within;  // places that are followed by one of the same tile,
    bool some_within = false;
    PlaceSet across;  // and by one of the next, so many places before
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

}  // namespace silhouette
