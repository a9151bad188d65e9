// SPDX-License-Identifier: Apache-2.0
// The tiles of a configuration space as maps hold them.
#pragma once

#include <memory>
#include <vector>

#include "clients/cpp/off_grid.h"
#include "silhouette/configuration_space.h"

namespace silhouette::client {

// Takes away the bits that mean nothing: of places beyond the grid's rim, of places that are called
// both free and occupied, and of cells that begin at one that is not free.
void MakeConsistent(const ConfigurationGrid& grid, ConfigurationSpaceTile& tile);

// What a consistent tile says of a place in it.
inline State StateIn(const ConfigurationSpaceTile& tile, uint64_t place) {
  if ((tile.free[place / 64] >> (place % 64) & 1) != 0) return State::kFree;
  if ((tile.occupied[place / 64] >> (place % 64) & 1) != 0) return State::kOccupied;
  return State::kUnknown;
}

// How many places are set.
uint64_t CountBits(const TileBits& bits);

// Adds its free and occupied places to `counts`.
void Count(const ConfigurationSpaceTile& tile, StateCounts& counts);

// A map by its tiles; maps that follow one another share those that stayed the same.
struct SpaceMap {
  // More cannot be held: 17 thousand million configurations.
  static constexpr uint64_t kMostTiles = uint64_t{1} << 22;

  ConfigurationGrid grid;
  // By their numbers, all consistent; null: unknown.
  std::vector<std::shared_ptr<const ConfigurationSpaceTile>> tiles;
  // As CheckInMap's cells have it.
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
      return CellState::kNotTold;
    }
    const uint64_t word = (*tiles[tile]->free_cells)[number % kTileSize / 64];
    if ((word >> (number % 64) & 1) != 0) return CellState::kFree;
    return cells_exact ? CellState::kOccupied : CellState::kNotTold;
  }
};

}  // namespace silhouette::client
