// SPDX-License-Identifier: Apache-2.0
// Which cells of the grid are free: collision checking, off the grid, for all of a tile at once.
//
// The grid cell that begins at a configuration reaches to the next value along every joint: round
// the turn on a continuous one, and no further than the rim on any other. Off the grid the union of
// the robot images at the corners is tested (OffGrid::kCell). It touches a plane if the image at
// any corner does: what touches, per view, is spread to the cells that it is a corner of, and the
// views vote after that.
//
// A cell is called free only if the test finds the union of all its corners free and that of any of
// them, too: that is, any place in the cell, its rim included. This holds because a larger robot
// image never makes anything free here:
//   * It touches no fewer planes; and an empty image, where that counts as touching (PlaneVotes),
//     is counted at each corner, not for the union.
//   * Lines in the intersection images convict, at most, views with something other than background
//     inside the image, and only if some view has what convicts there. A larger image has no less
//     of either. What is not ruled out by that is not free.
//   * What is possible in space (the sound presets) is found, at most, where its planes touch. The
//     robot's body, with which the test may find a place free all the same, is not looked at.
// A corner that has no robot image that can be read makes the cell not free, and so does one next
// to which a place is forbidden (RobotImageTable::present): any place is next to a corner of its
// cell.
#pragma once

#include <cstdint>
#include <span>

#include "db/index/place_set.h"
#include "db/index/tile_index.h"
#include "server/collision/space_checker.h"

namespace silhouette {

// Refers to the test, which must outlive it. Used by any number of threads.
class CellChecker {
 public:
  explicit CellChecker(const SpaceChecker& test);

  const ConfigurationGrid& grid() const { return table().grid(); }

  // Whether no cell can be free, whatever the tile.
  bool none_free() const { return none_free_; }

  // Whether a cell that is not free, though all its corners can be judged, is occupied at every
  // place that takes all of its corners.
  bool exact() const { return exact_; }

  // How many sets there are for a tile.
  size_t sets() const { return sets_; }

  // In which of the sets but the first there may be any of a tile: bit i - 1 for set i. `index` as
  // for LookUp. With more than 64 sets beside the first: all bits.
  uint64_t MayTouch(const TileIndex* index) const;
  // Whether a cell can be other than free for what its corners touch, if they are in tiles of which
  // these sets may have any.
  bool MayBeOccupied(uint64_t may_touch) const;

  // Makes `sets`, sets() of them, those of the tile: the configurations that cannot be judged, and
  // those that touch something in some view. `index`: that of the tile, of robot images that are
  // those of the test's table; null: they are looked at one by one. False if one of them could not
  // be read. `judged_only`: only report which cannot be judged, if the index shows that.
  bool LookUp(uint64_t tile, const TileIndex* index, bool judged_only,
              std::span<PlaceSet> sets) const;

  // The cells that are free. `sets`: as LookUp makes them, of all corners of each cell together
  // (JointStep).
  PlaceSet Free(std::span<const PlaceSet> sets) const;

 private:
  const RobotImageTable& table() const { return test_.test_.table_; }
  // Calls `each(votes)` for all that a verdict rests on, in the order of the sets.
  template <typename Each>
  void ForAllVotes(const Each& each) const;
  bool LookAtImages(uint64_t tile, std::span<PlaceSet> sets) const;

  const SpaceChecker& test_;
  bool none_free_ = false;
  bool exact_ = false;
  size_t sets_ = 0;
};

}  // namespace silhouette
