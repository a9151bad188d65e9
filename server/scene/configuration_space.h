// SPDX-License-Identifier: Apache-2.0
// The configuration-space map: the verdicts on all configurations of the grid, for one scene and
// one policy.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "db/index/place_set.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/clearance.h"
#include "server/collision/collision_checker.h"
#include "server/collision/free_cells.h"
#include "server/collision/level_checker.h"
#include "server/collision/policy.h"
#include "server/collision/space_checker.h"
#include "server/collision/stop.h"
#include "server/collision/verdict.h"
#include "server/scene/made_once.h"
#include "server/scene/scene_store.h"

namespace silhouette {

// Keeps database and scene alive. A tile is worked out when it is first asked for, by the collision
// index where the database has one, and never changes. Used by any number of threads.
//
// Speaks of the scene, not of its age: who uses a verdict must ask BlockedReason (checker.h), too.
class ConfigurationSpace {
 public:
  // The scene must be there; std::invalid_argument if not, if the policy cannot be, or if the
  // database cannot serve it. All tiles of a scene that is blocked, or of another generation, are
  // unknown.
  ConfigurationSpace(Served served, const Policy& policy);

  uint64_t tiles() const { return tiles_.size(); }

  const TileVerdicts& tile(uint64_t tile) const {
    return *tiles_.Get(tile, nullptr, [this](uint64_t asked) { return Make(asked, nullptr); });
  }
  // Works these tiles out. False if it was given up; what is ready stays so, another call goes on
  // from there.
  bool WorkOut(std::span<const uint64_t> tiles, const Stop& stop) const;

  // Whether working the tile out is a look into the index, and nothing has to be tested singly.
  bool looked_up(uint64_t tile) const;

  // Whether the tile has been worked out.
  bool ready(uint64_t tile) const { return tiles_.ready(tile); }

  // The state of a configuration; kUnknown for a number that no configuration has.
  State state(ConfigurationNumber number) const {
    if (number / kTileSize >= tiles()) return State::kUnknown;
    const TileVerdicts& verdicts = tile(number / kTileSize);
    const uint64_t place = number % kTileSize;
    if ((verdicts.free[place / 64] >> (place % 64) & 1) != 0) return State::kFree;
    if ((verdicts.occupied[place / 64] >> (place % 64) & 1) != 0) return State::kOccupied;
    return State::kUnknown;
  }

  // Whether a configuration is free, as far as that has been worked out.
  bool KnownFree(ConfigurationNumber number) const {
    return number / kTileSize < tiles() && ready(number / kTileSize) &&
           state(number) == State::kFree;
  }

  // The states of many configurations: bit i % 64 of word i / 64 of `free` or `occupied` is set for
  // numbers[i], the other bits are not. Each of both has a word for every 64 numbers begun, else
  // std::invalid_argument. False if it was given up, as WorkOut is.
  bool States(std::span<const uint32_t> numbers, std::span<uint64_t> free,
              std::span<uint64_t> occupied, const Stop& stop = nullptr) const;

  // Which grid cells are free off the grid (OffGrid::kCell), as cell_checker.h has it: what the
  // whole map takes again, and only if it is asked for. None of a robot that is drawn: its images
  // at the corners say nothing of what is in between. As FreeCells::WorkOut; `tiles` and others are
  // worked out, and the sets of cells_ready ones can be looked at.
  bool WorkOutCells(std::span<const uint64_t> tiles, const Stop& stop) const;
  bool cells_ready(uint64_t tile) const;
  // The cells that begin at the configurations of a tile; none of one that is not ready.
  const PlaceSet& free_cells(uint64_t tile) const;
  // Whether a cell that is not among them, in a tile that is ready, is occupied at every place that
  // takes all of its corners, if the states of all these are known.
  bool cells_exact() const;

 private:
  // By itself, as it is made when cells are first asked for.
  struct Cells {
    Cells(const CollisionChecker& test, const ServedDatabase& database);
    std::vector<PixelTree> trees;
    SpaceChecker test;
    FreeCells free;
  };

  // The indices of a tile's nodes.
  struct NodeTile {
    const TileIndex& own;
    const TileIndex& reach;
  };
  // Nothing if they do not decide, or one is not there.
  std::optional<NodeTile> NodesOf(uint64_t tile) const;
  std::optional<TileVerdicts> Make(uint64_t tile, const Stop& stop) const;
  bool HasCells() const;

  Served served_;
  // Nothing where all is unknown.
  std::optional<CollisionChecker> test_;
  std::optional<SpaceChecker> by_index_;
  TilesMadeOnce<TileVerdicts> tiles_;
  mutable std::once_flag cells_once_;
  mutable std::atomic<bool> cells_made_ = false;
  mutable std::unique_ptr<Cells> cells_;
};

// The configuration space in clearance levels: for one scene and one policy, which of the free
// configurations have more clearance (clearance.h) than each of some levels.
// Keeps database and scene alive. A tile is worked out when it is first asked for, by the collision
// index where the database has one, and never changes. Used by any number of threads.
class ClearanceSpace {
 public:
  // `verdicts`: the map of the same scene and policy, whose tiles are worked out with those here.
  // `levels`: in pixels of the masks; std::invalid_argument as RequireLevels has it.
  ClearanceSpace(std::shared_ptr<const ConfigurationSpace> verdicts, Served served,
                 const Policy& policy, std::vector<double> levels);

  const std::shared_ptr<const ConfigurationSpace>& verdicts() const { return verdicts_; }
  const std::vector<double>& levels() const { return levels_; }

  // Per level the configurations of the tile that are free and have more clearance; none of nodes
  // of an arm.
  std::span<const PlaceSet> tile(uint64_t tile) const {
    return *tiles_.Get(tile, nullptr, [this](uint64_t asked) { return Make(asked, nullptr); });
  }
  // As ConfigurationSpace::WorkOut, the verdicts of the tiles as well.
  bool WorkOut(std::span<const uint64_t> tiles, const Stop& stop) const;

  // Whether the tile has been worked out.
  bool ready(uint64_t tile) const { return tiles_.ready(tile); }

  // What it takes when all tiles are worked out.
  uint64_t bytes() const { return tiles_.size() * levels_.size() * sizeof(PlaceSet); }

 private:
  const LevelChecker& Test() const;
  std::optional<std::vector<PlaceSet>> Make(uint64_t tile, const Stop& stop) const;

  std::shared_ptr<const ConfigurationSpace> verdicts_;
  Served served_;
  Policy policy_;
  std::vector<double> levels_;
  // What levels are found with, made with the first tile that has a free configuration.
  mutable std::once_flag prepare_;
  mutable std::optional<CollisionChecker> test_;
  mutable std::optional<ClearanceMeter> meter_;
  mutable std::optional<LevelChecker> level_checker_;
  TilesMadeOnce<std::vector<PlaceSet>> tiles_;
};

}  // namespace silhouette
