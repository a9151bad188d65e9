// SPDX-License-Identifier: Apache-2.0
// The tiles of a map of the configuration space.
#pragma once

#include <memory>
#include <vector>

#include "clients/cpp/off_grid.h"
#include "silhouette/configuration_space.h"

namespace silhouette::client {

// Clears the bits without a meaning: of places beyond the grid's rim, of places that are both free
// and occupied, and of cells that begin at a place that is not free.
void MakeConsistent(const ConfigurationGrid& grid, ConfigurationSpaceTile& tile);

// The state of a place in a consistent tile.
inline State StateIn(const ConfigurationSpaceTile& tile, uint64_t place) {
  if ((tile.free[place / 64] >> (place % 64) & 1) != 0) return State::kFree;
  if ((tile.occupied[place / 64] >> (place % 64) & 1) != 0) return State::kOccupied;
  return State::kUnknown;
}

// Number of set places.
uint64_t CountBits(const TileBits& bits);

// Adds its free and occupied places to `counts`.
void Count(const ConfigurationSpaceTile& tile, StateCounts& counts);

// A map by its tiles; successive maps share unchanged tiles.
struct SpaceMap {
  // More cannot be held: 17 thousand million configurations.
  static constexpr uint64_t kMostTiles = uint64_t{1} << 22;

  ConfigurationGrid grid;
  // By their numbers, all consistent; null: unknown.
  std::vector<std::shared_ptr<const ConfigurationSpaceTile>> tiles;
  // As the cells of CheckInMap.
  bool cells_exact = false;

  // Unknown also for a number that no configuration has.
  State StateAt(ConfigurationNumber number) const {
    const uint64_t tile = number / kTileSize;
    if (tile >= tiles.size() || tiles[tile] == nullptr) return State::kUnknown;
    return StateIn(*tiles[tile], number % kTileSize);
  }

  CellState CellAt(ConfigurationNumber number) const {
    const uint64_t tile = number / kTileSize;
    if (tile >= tiles.size() || tiles[tile] == nullptr || !tiles[tile]->free_cells) {
      return CellState::kUnknown;
    }
    const uint64_t word = (*tiles[tile]->free_cells)[number % kTileSize / 64];
    if ((word >> (number % 64) & 1) != 0) return CellState::kFree;
    return cells_exact ? CellState::kOccupied : CellState::kUnknown;
  }
};

}  // namespace silhouette::client
