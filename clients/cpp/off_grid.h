// SPDX-License-Identifier: Apache-2.0
// The verdict of a map on any configuration: the server's verdict, or unknown.
#pragma once

#include <optional>
#include <span>

#include "silhouette/configuration_grid.h"
#include "silhouette/policy.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// How the server treats a configuration off the grid.
struct OffGridRule {
  OffGrid off_grid = OffGrid::kCell;
  // Whether a grid cell is free if all its corners are. The server tests the union of the robot
  // images at the corners, which may touch obstacles in more views than any of them does.
  bool free_corners_suffice = false;
  // Whether a place is occupied if a corner around it is. Not so where the server looks at the
  // robot's body, which touches more at the corner.
  bool occupied_corner_suffices = false;
  // The server draws the robot off the grid: grid points say nothing of what is in between.
  bool drawn = false;
};

// What a map knows about the grid cell that begins at a configuration: the box to the next value
// along every joint. It has no extent along a joint that is at its last value and not continuous.
enum class CellState {
  kUnknown,
  kFree,      // throughout, its rim included
  kOccupied,  // where all of its corners count, if all of them are free or occupied
};

// A map without cells.
inline constexpr auto kNoCells = [](ConfigurationNumber) { return CellState::kUnknown; };

// The first corner of the cell that holds `q`; nothing outside the grid.
inline std::optional<ConfigurationNumber> CellOf(const ConfigurationGrid& grid,
                                                 std::span<const double> q) {
  if (q.size() != grid.joints().size()) return std::nullopt;
  GridIndex low{};
  for (size_t j = 0; j < q.size(); ++j) {
    const std::optional<double> place = grid.Place(static_cast<int>(j), q[j]);
    if (!place) return std::nullopt;
    low[j] = static_cast<int>(*place);
  }
  return grid.NumberOf(low);
}

// Whether one of the cells that hold `q` is free; `low`: the first of `q`'s own corners.
// `cell_at`: the CellState of a ConfigurationNumber.
template <typename CellAt>
bool InFreeCell(const ConfigurationGrid& grid, std::span<const double> q, ConfigurationNumber low,
                const CellAt& cell_at) {
  if (cell_at(low) == CellState::kFree) return true;
  const std::optional<GridIndex> first = grid.IndexOf(low);
  if (!first) return false;
  // On a grid value of a joint, `q` is in the cells on both sides.
  unsigned on_value = 0;
  for (int j = 0; j < grid.dimensions(); ++j) {
    const std::optional<double> place = grid.Place(j, q[static_cast<size_t>(j)]);
    if (place && *place == (*first)[static_cast<size_t>(j)]) on_value |= 1u << j;
  }
  for (unsigned back = on_value; back != 0; back = (back - 1) & on_value) {
    std::optional<GridIndex> at = first;
    for (int j = 0; at && j < grid.dimensions(); ++j) {
      if ((back >> j & 1) != 0) at = grid.Neighbour(*at, j, -1);
    }
    if (at && cell_at(grid.NumberOf(*at)) == CellState::kFree) return true;
  }
  return false;
}

// Whether these are all corners of the cell that begins at the first of them.
inline bool AreWholeCell(const ConfigurationGrid& grid, const CellCorners& corners) {
  const std::optional<GridIndex> first = grid.IndexOf(corners.numbers()[0]);
  int whole = 1;
  for (size_t j = 0; first && j < grid.joints().size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    if (joint.continuous || (*first)[j] + 1 < joint.steps) whole *= 2;
  }
  return corners.count() == whole;
}

// The policy that the server uses for a request. `defaults`: Database::default_policy.
Policy Effective(const Policy& asked, const Policy& defaults);

// `policy`: the result of Effective. `views`: of the database, 0 if unknown. Free corners suffice
// if a single view decides, by its own pixels alone.
OffGridRule OffGridRuleOf(const Policy& policy, int views);

// The verdict on `q`. `state_at`: the state of a ConfigurationNumber; `cell_at`: as above. Free or
// occupied only if the server returns the same; otherwise unknown, also where the map has no state.
// Without evidence and without hidden_possible.
template <typename StateAt, typename CellAt>
Verdict CheckInMap(const ConfigurationGrid& grid, const OffGridRule& rule,
                   std::span<const double> q, const StateAt& state_at, const CellAt& cell_at) {
  Verdict verdict{.reason = Reason::kOutsideGrid};
  if (rule.off_grid == OffGrid::kNearest && !rule.drawn) {
    const std::optional<ConfigurationNumber> nearest = grid.Nearest(q);
    if (!nearest) return verdict;
    verdict.state = state_at(*nearest);
    verdict.reason = verdict.state == State::kUnknown ? Reason::kNotInMap : Reason::kUnspecified;
    return verdict;
  }
  const std::optional<ConfigurationNumber> cell = CellOf(grid, q);
  if (!cell) return verdict;
  if (!rule.drawn && cell_at(*cell) == CellState::kFree) return {.state = State::kFree};
  const CellCorners corners = grid.CornersAround(q);
  if (rule.drawn && corners.count() > 1) return {.reason = Reason::kBetweenGridPoints};
  bool occupied = false;
  for (const ConfigurationNumber corner : corners.numbers()) {
    const State state = state_at(corner);
    if (state == State::kUnknown) {
      verdict.reason = Reason::kNotInMap;
      return verdict;
    }
    occupied = occupied || state == State::kOccupied;
  }
  const ConfigurationNumber low = *cell;
  if (occupied) {
    const bool decided = corners.count() == 1 || rule.occupied_corner_suffices;
    verdict.state = decided ? State::kOccupied : State::kUnknown;
  } else if (corners.count() == 1 || rule.free_corners_suffice ||
             InFreeCell(grid, q, low, cell_at)) {
    verdict.state = State::kFree;
  } else if (cell_at(low) == CellState::kOccupied && AreWholeCell(grid, corners)) {
    verdict.state = State::kOccupied;
  }
  verdict.reason =
      verdict.state == State::kUnknown ? Reason::kBetweenGridPoints : Reason::kUnspecified;
  return verdict;
}

}  // namespace silhouette::client
