// SPDX-License-Identifier: Apache-2.0
// Path planning by wave propagation on the configuration grid (paper §4.2; Latombe 1991): a wave
// spreads from the goal over the free grid points, and the path descends from the start against it.
//
// Whatever is not free is an obstacle, unknown too.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "db/mask/configuration_grid.h"

namespace silhouette {

// Which grid points are one move away.
enum class Moves {
  // 2 d: one joint moves one step.
  kAxes,
  // 3^d - 1: any number of joints move one step each at once, and no corner is cut: every grid
  // point of the box that the move spans must be free.
  kDiagonals,
};

struct PlannerOptions {
  Moves moves = Moves::kAxes;
  // Leave out the grid points where the path goes straight on.
  bool simplify = true;
};

// The free places. Each answer is true for free only, never for unknown, and must not change while
// a path is planned.
struct FreeSpace {
  // A grid point. Called at most once for each.
  std::function<bool(ConfigurationNumber)> point;
  // At a start or a goal off the grid; empty: the corners of the grid cell decide alone.
  std::function<bool(std::span<const double>)> configuration = nullptr;
  // On the straight way between two grid points one move apart, where Moves allows the move; the
  // same in both directions. Empty: always.
  std::function<bool(ConfigurationNumber, ConfigurationNumber)> move = nullptr;
};

enum class PlanOutcome {
  kNotConnected = 0,  // no way leads from the start to the goal
  kFound,
  kStartOutsideGrid,  // or not finite, or the wrong number of values
  kGoalOutsideGrid,
  kStartBlocked,  // the start, or a corner of its grid cell, is not free
  kGoalBlocked,
};

// "no way leads from the start to the goal" and the like.
std::string Describe(PlanOutcome outcome);

struct Plan {
  PlanOutcome outcome = PlanOutcome::kNotConnected;
  // From the start to the goal; empty if there is no path. Between two of them the path is
  // straight. Continuous joints go on beyond the turn, so that this holds for them too: the first
  // waypoint is the start as given, the last one the goal up to whole turns.
  std::vector<Configuration> waypoints = {};
  // In grid steps: one for each move along one joint, sqrt(k) for a move of k joints; the ways
  // between an end off the grid and its corner count with their straight length.
  double length = 0;
  // Grid points that the wave reached.
  uint64_t visited = 0;

  bool found() const { return outcome == PlanOutcome::kFound; }
};

// The shortest path (Plan::length) from `start` to `goal` over free grid points. An end off the
// grid is joined to a corner of its grid cell; all these corners, and the end itself, must be free.
// Two ends of which one lies in the grid cell of the other are joined directly.
//
// The same input gives the same path: of several shortest ones it leaves the start by the corner
// that ConfigurationGrid::CornersAround lists first, then goes straight on as long as it can, else
// takes the move that comes first: fewer joints before more, earlier joints before later ones,
// forwards before backwards.
//
// Takes memory in proportion to the tiles that the wave reaches (36 KB each), and handles paths of
// less than 2^31 steps.
Plan PlanByWavePropagation(const ConfigurationGrid& grid, const FreeSpace& space,
                           std::span<const double> start, std::span<const double> goal,
                           const PlannerOptions& options = {});

}  // namespace silhouette
