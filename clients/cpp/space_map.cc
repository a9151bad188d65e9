// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/space_map.h"

#include <bit>

namespace silhouette::client {

uint64_t CountBits(const TileBits& bits) {
  uint64_t count = 0;
  for (uint64_t word : bits) count += static_cast<uint64_t>(std::popcount(word));
  return count;
}

void MakeConsistent(const ConfigurationGrid& grid, ConfigurationSpaceTile& tile) {
  for (size_t word = 0; word < tile.free.size(); ++word) {
    const uint64_t both = tile.free[word] & tile.occupied[word];
    tile.free[word] &= ~both;
    tile.occupied[word] &= ~both;
  }
  const ConfigurationNumber first = tile.tile * kTileSize;
  // A tile with its last place has all of them.
  const bool all = grid.Contains(first + kTileSize - 1);
  for (uint64_t place = 0; !all && place < kTileSize; ++place) {
    if (grid.Contains(first + place)) continue;
    const uint64_t others = ~(uint64_t{1} << (place % 64));
    tile.free[place / 64] &= others;
    tile.occupied[place / 64] &= others;
  }
  for (size_t word = 0; tile.free_cells && word < tile.free.size(); ++word) {
    (*tile.free_cells)[word] &= tile.free[word];
  }
}

void Count(const ConfigurationSpaceTile& tile, StateCounts& counts) {
  counts.free += CountBits(tile.free);
  counts.occupied += CountBits(tile.occupied);
}

}  // namespace silhouette::client
