// SPDX-License-Identifier: Apache-2.0
// The verdicts of all configurations of the grid, from one scene: looked up locally, in
// nanoseconds.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "silhouette/answers.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// Bit i % 64 of word i / 64 belongs to place i of the tile.
using TileBits = std::array<uint64_t, kTileSize / 64>;

struct ConfigurationSpaceTile {
  uint64_t tile = 0;
  TileBits free{};
  TileBits occupied{};
  // Per requested clearance level: the configurations of `free` with more clearance.
  std::vector<TileBits> above{};
  // The configurations whose grid cell, from there to the next value along every joint, is free
  // throughout; nothing if the server did not report it.
  std::optional<TileBits> free_cells = std::nullopt;
};

struct StateCounts {
  uint64_t free = 0;
  uint64_t occupied = 0;
  uint64_t unknown = 0;
};

// A bound of a configuration's clearance (docs/concepts.md).
struct ClearanceBound {
  // Only a free configuration has a clearance.
  State state = State::kUnknown;
  // The greatest requested level that its clearance exceeds: a lower bound. Nothing if it exceeds
  // none, or is not free.
  std::optional<double> exceeds;

  bool operator==(const ClearanceBound&) const = default;
};

// The verdicts of one scene, which may be old: check basis().Age() before use. Immutable; any
// number of threads may read it.
class ConfigurationSpace {
 public:
  // Configurations of a tile that is not among `tiles` are unknown, so are those that a tile calls
  // both free and occupied, and all if `basis` has no scene or there is an `unknown_reason`.
  // `clearance_levels`: in pixels of the masks, ascending; a configuration counts as above a level
  // only if it is free and above all lower levels. Throws std::invalid_argument for a tile beyond
  // the grid, a repeated tile, a tile with other levels, and for levels that do not ascend.
  ConfigurationSpace(ConfigurationGrid grid, Basis basis, std::vector<ConfigurationSpaceTile> tiles,
                     uint64_t tiles_left_out = 0, std::vector<double> clearance_levels = {},
                     std::optional<Reason> unknown_reason = std::nullopt);

  const ConfigurationGrid& grid() const { return grid_; }
  const Basis& basis() const { return basis_; }

  // Why everything is unknown; nothing if verdicts were valid when they came.
  std::optional<Reason> unknown_reason() const { return unknown_reason_; }

  // Number of requested tiles that the server had no time for.
  uint64_t tiles_left_out() const { return tiles_left_out_; }

  // Unknown also for a number that no configuration of the grid has.
  State StateAt(ConfigurationNumber number) const;
  bool IsFree(ConfigurationNumber number) const { return StateAt(number) == State::kFree; }

  // Over all configurations of the grid.
  StateCounts Count() const;

  // The requested levels.
  const std::vector<double>& clearance_levels() const { return clearance_levels_; }

  // Unknown also for a number that no configuration of the grid has.
  ClearanceBound ClearanceAt(ConfigurationNumber number) const;

  // Per level, how many configurations are free and have more clearance.
  std::vector<uint64_t> CountAbove() const;

 private:
  ConfigurationGrid grid_;
  Basis basis_;
  std::vector<ConfigurationSpaceTile> tiles_;
  uint64_t tiles_left_out_ = 0;
  std::vector<double> clearance_levels_;
  std::optional<Reason> unknown_reason_;
  std::unordered_map<uint64_t, size_t> places_;  // tile -> index into tiles_
};

}  // namespace silhouette::client
