// SPDX-License-Identifier: Apache-2.0
// Collision checking for all configurations of a tile at once, by the collision index.
//
// What planes alone decide is looked up: the configurations whose robot image touches the planes in
// enough views. Where the policy looks further - lines in the intersection images, places in space
// - two lookups bound it: what is occupied for certain, and what may be. Only configurations in
// between are tested singly.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "db/index/pixel_tree.h"
#include "db/index/place_set.h"
#include "db/index/tile_index.h"
#include "server/collision/collision_checker.h"
#include "server/collision/stop.h"

namespace silhouette {

// Planes, one per view, and in how many views a robot image must touch them.
class PlaneVotes {
 public:
  // `planes`: nothing for a view that counts as touched. `beyond`: empty, or per view whether an
  // empty robot image counts as touching. `trees`: one per view, of the planes' sizes.
  PlaneVotes(std::span<const PixelTree> trees, const CollisionImages& planes, int min_views,
             const std::vector<bool>& beyond = {});

  // The configurations that touch in enough views.
  PlaceSet Touching(const TileIndex& index) const;

  // The same in parts, for i = 0 .. views() - 1, the views that do not count as touched anyway:
  // those that touch in view i, ...
  size_t views() const { return views_.size(); }
  PlaceSet TouchingIn(size_t i, const TileIndex& index) const;
  // ... or whether one does that has this robot image there, ...
  bool TouchesIn(size_t i, MaskWords robot_image) const;
  int view(size_t i) const { return views_[i].view; }
  // ... and what is enough of these sets, one per i. No view need be touched: all.
  PlaceSet InEnough(std::span<const PlaceSet> touching) const;
  // The same of whole tiles: whether any touches there, and whether that many views are enough.
  bool AnyTouchesIn(size_t i, const TileIndex& index) const;
  bool IsEnough(int touching) const { return touching >= needed_; }
  // Whether an empty robot image counts as touching in any view.
  bool beyond() const;

 private:
  struct View {
    int view = 0;
    Mask plane;
    Nodes cover;
    bool beyond = false;
    Nodes root;
  };

  std::vector<View> views_;
  int needed_ = 0;  // of these; the rest are touched anyway
};

// Refers to the test, which must outlive it. Used by any number of threads.
class SpaceChecker {
 public:
  // `trees`: those of the index, one per view, of the masks' sizes.
  SpaceChecker(const CollisionChecker& test, std::span<const PixelTree> trees);

  // The same as test.CheckTile(tile). `index`: that of the tile, made of robot images that are
  // those of the test's table; a configuration that it does not have is unknown.
  TileVerdicts CheckTile(uint64_t tile, const TileIndex& index) const {
    return *CheckTile(tile, index, nullptr);
  }
  // Nothing: it was given up.
  std::optional<TileVerdicts> CheckTile(uint64_t tile, const TileIndex& index,
                                        const Stop& stop) const;

  // The same of nodes of an arm (drawn_kind.h), by the indices of their images, if planes_decide()
  // and the preset is not a sound one. A node that one of them does not have is unknown.
  TileVerdicts CheckNodes(const TileIndex& own, const TileIndex& reach) const;

  // Whether CheckTile tests none singly, whatever the tile.
  bool planes_decide() const { return possible_.empty() && !everything_possible_; }

  // The configurations of the tile that CheckTile would test singly.
  PlaceSet Open(const TileIndex& index) const;

 private:
  friend class CellChecker;
  void BoundLines(std::span<const PixelTree> trees);
  void BoundPossibleSpace(std::span<const PixelTree> trees);
  PlaceSet Occupied(const TileIndex& index) const;
  // Those where the robot leaves the test's workspace.
  PlaceSet Leaving(uint64_t tile, const PlaceSet& among) const;

  const CollisionChecker& test_;
  // Occupied if one of these is touched ...
  std::vector<PlaneVotes> occupied_;
  // ... and perhaps if one of these is, and also all of `witnesses_`.
  std::vector<PlaneVotes> possible_;
  std::vector<PlaneVotes> witnesses_;
  bool everything_possible_ = false;
};

}  // namespace silhouette
