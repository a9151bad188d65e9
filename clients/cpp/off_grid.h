// What a map of the grid's configurations tells of any configuration: what the server would say of
// it, or unknown.
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

// What the server makes of a request's policy. `defaults`: Database::default_policy.
Policy Effective(const Policy& asked, const Policy& defaults);

// `policy`: one that is Effective. `views`: of the database, 0 if that is not known. Free corners
// suffice where a single view convicts, by what it shows and by nothing else.
OffGridRule OffGridRuleOf(const Policy& policy, int views);

// The verdict on `q`. `state_at`: tells the state of a ConfigurationNumber. Never free or occupied
// where the server would not say the same; unknown where it might say either, or where the map has
// no state. Without evidence, and without telling whether an obstacle may hide.
template <typename StateAt>
Verdict CheckInMap(const ConfigurationGrid& grid, const OffGridRule& rule,
                   std::span<const double> q, const StateAt& state_at) {
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
  if (occupied) {
    verdict.state = State::kOccupied;
  } else if (corners.count() == 1 || rule.free_corners_suffice) {
    verdict.state = State::kFree;
  }
  verdict.reason =
      verdict.state == State::kUnknown ? Reason::kBetweenGridPoints : Reason::kUnspecified;
  return verdict;
}

}  // namespace silhouette::client
