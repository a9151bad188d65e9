// SPDX-License-Identifier: Apache-2.0
// The verdict of a map on any configuration: the server's verdict, or unknown.
#pragma once

#include <optional>
#include <span>

#include "silhouette/configuration_grid.h"
#include "silhouette/policy.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// What stands for a configuration off the grid.
struct OffGridRule {
  OffGrid off_grid = OffGrid::kCell;
  // Whether a grid cell is free if all its corners are. The server tests the union of the robot
  // images at the corners, which may touch obstacles in more views than any of them does.
  bool free_corners_suffice = false;
};

// What a map has of the grid cell that begins at a configuration: the box to the next value along
// every joint; along a joint without one, not continuous, it has no extent.
enum class CellState {
  kNotTold,
  kFree,      // throughout, its rim included
  kOccupied,  // where all of its corners count, if all of them are free or occupied
};

// A map without cells.
inline constexpr auto kNoCells = [](ConfigurationNumber) { return CellState::kNotTold; };

// Whether one of the cells that hold `q` is free; `low`: the first of `q`'s own corners.
// `cell_at`: the CellState of a ConfigurationNumber.
template <typename CellAt>
bool InFreeCell(const ConfigurationGrid& grid, std::span<const double> q, ConfigurationNumber low,
                const CellAt& cell_at) {
  if (cell_at(low) == CellState::kFree) return true;
  const std::optional<GridIndex> first = grid.IndexOf(low);
  if (!first) return false;
  // On a grid value along a joint, it is in the cells on both sides of that.
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

// What the server makes of a request's policy. `defaults`: Database::default_policy.
Policy Effective(const Policy& asked, const Policy& defaults);

// `policy`: one that is Effective. `views`: of the database, 0 if that is not known. Free corners
// suffice where a single view convicts, by what it shows and by nothing else.
OffGridRule OffGridRuleOf(const Policy& policy, int views);

// The verdict on `q`. `state_at`: the state of a ConfigurationNumber; `cell_at`: as above.
// Never free or occupied where the server would not say the same; unknown where it might say
// either, or where the map has no state. Without evidence, and without telling whether an obstacle
// may hide.
template <typename StateAt, typename CellAt>
Verdict CheckInMap(const ConfigurationGrid& grid, const OffGridRule& rule,
                   std::span<const double> q, const StateAt& state_at, const CellAt& cell_at) {
  Verdict verdict{.reason = Reason::kOutsideGrid};
  if (rule.off_grid == OffGrid::kNearest) {
    const std::optional<ConfigurationNumber> nearest = grid.Nearest(q);
    if (!nearest) return verdict;
    verdict.state = state_at(*nearest);
    verdict.reason = verdict.state == State::kUnknown ? Reason::kNotInMap : Reason::kUnspecified;
    return verdict;
  }
  const CellCorners corners = grid.CornersAround(q);
  if (corners.count() == 0) return verdict;
  bool occupied = false;
  for (const ConfigurationNumber corner : corners.numbers()) {
    const State state = state_at(corner);
    if (state == State::kUnknown) {
      verdict.reason = Reason::kNotInMap;
      return verdict;
    }
    occupied = occupied || state == State::kOccupied;
  }
  const ConfigurationNumber low = corners.numbers()[0];
  if (occupied) {
    verdict.state = State::kOccupied;
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
