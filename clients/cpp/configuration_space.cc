#include "silhouette/configuration_space.h"

#include <bit>
#include <stdexcept>
#include <string>
#include <utility>

namespace silhouette::client {
namespace {

// Takes away the bits that mean nothing: of places beyond the grid's rim, and of places that are
// called both free and occupied.
void MakeConsistent(const ConfigurationGrid& grid, ConfigurationSpaceTile& tile) {
  for (size_t word = 0; word < tile.free.size(); ++word) {
    const uint64_t both = tile.free[word] & tile.occupied[word];
    tile.free[word] &= ~both;
    tile.occupied[word] &= ~both;
  }
  const ConfigurationNumber first = tile.tile * kTileSize;
  if (grid.Contains(first + kTileSize - 1)) return;  // a tile with its last place has all of them
  for (uint64_t place = 0; place < kTileSize; ++place) {
    if (grid.Contains(first + place)) continue;
    const uint64_t others = ~(uint64_t{1} << (place % 64));
    tile.free[place / 64] &= others;
    tile.occupied[place / 64] &= others;
  }
}

uint64_t CountBits(const TileBits& bits) {
  uint64_t count = 0;
  for (uint64_t word : bits) count += static_cast<uint64_t>(std::popcount(word));
  return count;
}

}  // namespace

ConfigurationSpace::ConfigurationSpace(ConfigurationGrid grid, Basis basis,
                                       std::vector<ConfigurationSpaceTile> tiles,
                                       uint64_t tiles_left_out)
    : grid_(std::move(grid)),
      basis_(std::move(basis)),
      tiles_(std::move(tiles)),
      tiles_left_out_(tiles_left_out) {
  if (basis_.scene_id == 0) tiles_.clear();
  for (size_t i = 0; i < tiles_.size(); ++i) {
    if (tiles_[i].tile >= grid_.tiles()) {
      throw std::invalid_argument("tile " + std::to_string(tiles_[i].tile) +
                                  " is beyond the grid's " + std::to_string(grid_.tiles()));
    }
    if (!places_.emplace(tiles_[i].tile, i).second) {
      throw std::invalid_argument("tile " + std::to_string(tiles_[i].tile) + " comes twice");
    }
    MakeConsistent(grid_, tiles_[i]);
  }
}

State ConfigurationSpace::StateAt(ConfigurationNumber number) const {
  const auto found = places_.find(number / kTileSize);
  if (found == places_.end()) return State::kUnknown;
  const ConfigurationSpaceTile& tile = tiles_[found->second];
  const uint64_t place = number % kTileSize;
  if ((tile.free[place / 64] >> (place % 64) & 1) != 0) return State::kFree;
  if ((tile.occupied[place / 64] >> (place % 64) & 1) != 0) return State::kOccupied;
  return State::kUnknown;
}

StateCounts ConfigurationSpace::Count() const {
  StateCounts counts;
  for (const ConfigurationSpaceTile& tile : tiles_) {
    counts.free += CountBits(tile.free);
    counts.occupied += CountBits(tile.occupied);
  }
  counts.unknown = grid_.size() - counts.free - counts.occupied;
  return counts;
}

}  // namespace silhouette::client
