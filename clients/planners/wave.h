// SPDX-License-Identifier: Apache-2.0
// The wave: the cost of the shortest way from every grid point it reached to the goal.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "clients/planners/move_set.h"
#include "clients/planners/wave_propagation.h"
#include "db/mask/configuration_grid.h"

namespace silhouette {

// Not for several threads. `grid`, `moves` and `space` must outlive it.
class Wave {
 public:
  Wave(const ConfigurationGrid& grid, const std::vector<Move>& moves, const FreeSpace& space);

  // Whether the grid point is free; asks the predicate once.
  bool IsFree(ConfigurationNumber number);

  // Starts a wave at a free grid point that is `cost`, less than 3 steps, away from the goal.
  void Seed(ConfigurationNumber number, Cost cost);

  // A place from which the wave is looked for, and the cost of the way to it.
  struct Target {
    ConfigurationNumber number = 0;
    Cost join = 0;
  };

  // Spreads from the seeds until the cheapest of CostAt(target.number) + target.join is final, or
  // nothing is left to reach.
  void Spread(const std::vector<Target>& targets);

  // kUnreached if the wave did not get there.
  Cost CostAt(ConfigurationNumber number);

  // The move, as an index into the set, that leads from `index` down along a shortest way: `last`
  // if it does (-1: none), else the first of the set that does. -1 where none does.
  int Descend(const GridIndex& index, int last);

  uint64_t visited() const { return visited_; }

 private:
  struct Tile {
    Tile() { cost.fill(kUnreached); }
    std::array<Cost, kTileSize> cost;
    std::array<uint8_t, kTileSize> flags{};
  };
  struct Step {
    bool box_is_free = false;  // all grid points of the box that the move spans
    bool allowed = false;
    ConfigurationNumber number = 0;
  };

  Tile& TileOf(ConfigurationNumber number);
  void Reach(ConfigurationNumber number, Cost cost);
  void Expand(ConfigurationNumber number);
  // Where each move of the set leads from `index`.
  const std::vector<Step>& StepsFrom(const GridIndex& index);

  const ConfigurationGrid& grid_;
  const std::vector<Move>& moves_;
  const FreeSpace& space_;
  std::unordered_map<uint64_t, std::unique_ptr<Tile>> tiles_;
  uint64_t last_tile_number_ = 0;
  Tile* last_tile_ = nullptr;
  // Front f holds points whose cost, in whole steps, is f modulo 4: a move costs at least one step,
  // so no point of a front changes another of the same front, and less than 3.
  std::array<std::vector<ConfigurationNumber>, 4> fronts_;
  std::vector<Step> steps_;
  uint64_t visited_ = 0;
};

}  // namespace silhouette
