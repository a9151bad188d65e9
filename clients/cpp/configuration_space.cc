// SPDX-License-Identifier: Apache-2.0
#include "silhouette/configuration_space.h"

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include "clients/cpp/space_map.h"

namespace silhouette::client {
namespace {

// Clears the bits of a level that are not free and above all lower levels.
void MakeLevelsConsistent(ConfigurationSpaceTile& tile) {
  for (size_t word = 0; word < tile.free.size(); ++word) {
    uint64_t above_lower = tile.free[word];
    for (TileBits& above : tile.above) above_lower = above[word] &= above_lower;
  }
}

}  // namespace

ConfigurationSpace::ConfigurationSpace(ConfigurationGrid grid, Basis basis,
                                       std::vector<ConfigurationSpaceTile> tiles,
                                       uint64_t tiles_left_out,
                                       std::vector<double> clearance_levels,
                                       std::optional<Reason> unknown_reason)
    : grid_(std::move(grid)),
      basis_(std::move(basis)),
      tiles_(std::move(tiles)),
      tiles_left_out_(tiles_left_out),
      clearance_levels_(std::move(clearance_levels)),
      unknown_reason_(unknown_reason) {
  if (std::ranges::adjacent_find(clearance_levels_, std::greater_equal()) !=
      clearance_levels_.end()) {
    throw std::invalid_argument("clearance levels must ascend");
  }
  if (basis_.scene_id == 0 && !unknown_reason_) unknown_reason_ = Reason::kNoScene;
  if (unknown_reason_) tiles_.clear();
  for (size_t i = 0; i < tiles_.size(); ++i) {
    if (tiles_[i].tile >= grid_.tiles()) {
      throw std::invalid_argument("tile " + std::to_string(tiles_[i].tile) +
                                  " is beyond the grid's " + std::to_string(grid_.tiles()));
    }
    if (!places_.emplace(tiles_[i].tile, i).second) {
      throw std::invalid_argument("tile " + std::to_string(tiles_[i].tile) + " comes twice");
    }
    if (tiles_[i].above.size() != clearance_levels_.size()) {
      throw std::invalid_argument("tile " + std::to_string(tiles_[i].tile) + " has " +
                                  std::to_string(tiles_[i].above.size()) +
                                  " clearance levels instead of " +
                                  std::to_string(clearance_levels_.size()));
    }
    MakeConsistent(grid_, tiles_[i]);
    MakeLevelsConsistent(tiles_[i]);
  }
}

State ConfigurationSpace::StateAt(ConfigurationNumber number) const {
  const auto found = places_.find(number / kTileSize);
  if (found == places_.end()) return State::kUnknown;
  return StateIn(tiles_[found->second], number % kTileSize);
}

StateCounts ConfigurationSpace::Count() const {
  StateCounts counts;
  for (const ConfigurationSpaceTile& tile : tiles_) client::Count(tile, counts);
  counts.unknown = grid_.size() - counts.free - counts.occupied;
  return counts;
}

ClearanceBound ConfigurationSpace::ClearanceAt(ConfigurationNumber number) const {
  ClearanceBound bound{.state = StateAt(number), .exceeds = std::nullopt};
  if (bound.state != State::kFree) return bound;
  const ConfigurationSpaceTile& tile = tiles_[places_.at(number / kTileSize)];
  const uint64_t place = number % kTileSize;
  for (size_t i = 0; i < tile.above.size(); ++i) {
    if ((tile.above[i][place / 64] >> (place % 64) & 1) == 0) break;
    bound.exceeds = clearance_levels_[i];
  }
  return bound;
}

std::vector<uint64_t> ConfigurationSpace::CountAbove() const {
  std::vector<uint64_t> counts(clearance_levels_.size(), 0);
  for (const ConfigurationSpaceTile& tile : tiles_) {
    for (size_t i = 0; i < counts.size(); ++i) counts[i] += CountBits(tile.above[i]);
  }
  return counts;
}

}  // namespace silhouette::client
