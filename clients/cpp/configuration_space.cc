#include "silhouette/configuration_space.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "clients/cpp/space_map.h"

namespace silhouette::client {
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
  return StateIn(tiles_[found->second], number % kTileSize);
}

StateCounts ConfigurationSpace::Count() const {
  StateCounts counts;
  for (const ConfigurationSpaceTile& tile : tiles_) client::Count(tile, counts);
  counts.unknown = grid_.size() - counts.free - counts.occupied;
  return counts;
}

}  // namespace silhouette::client
