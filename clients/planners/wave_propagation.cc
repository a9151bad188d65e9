// SPDX-License-Identifier: Apache-2.0
#include "clients/planners/wave_propagation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>

#include "clients/planners/move_set.h"
#include "clients/planners/wave.h"

namespace silhouette {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

// Steps along each joint from the grid's origin; on continuous joints they go on beyond the turn.
using Unrolled = std::array<int64_t, kMaxJoints>;
using Places = std::array<double, kMaxJoints>;

// The start or the goal.
struct End {
  Configuration configuration;
  Places places{};  // in steps, see ConfigurationGrid::Place
  CellCorners corners;
};

// Nothing if the configuration is outside the grid.
std::optional<End> EndAt(const ConfigurationGrid& grid, std::span<const double> q) {
  End end{.configuration = Configuration(q.begin(), q.end()),
          .places = {},
          .corners = grid.CornersAround(q)};
  if (end.corners.count() == 0) return std::nullopt;
  for (int j = 0; j < grid.dimensions(); ++j) {
    end.places[static_cast<size_t>(j)] = *grid.Place(j, q[static_cast<size_t>(j)]);
  }
  return end;
}

// The shorter way from `from` to `to` along joint `j`, in steps.
double Way(const ConfigurationGrid& grid, size_t j, double from, double to) {
  const GridJoint& joint = grid.joints()[j];
  const double way = to - from;
  return joint.continuous ? way - std::round(way / joint.steps) * joint.steps : way;
}

Places PlacesOf(const ConfigurationGrid& grid, ConfigurationNumber number) {
  const GridIndex index = *grid.IndexOf(number);
  Places places{};
  std::copy(index.begin(), index.end(), places.begin());
  return places;
}

double Distance(const ConfigurationGrid& grid, const Places& a, const Places& b) {
  double squares = 0;
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    squares += std::pow(Way(grid, j, a[j], b[j]), 2);
  }
  return std::sqrt(squares);
}

// The ways between an end and its corners.
std::vector<Wave::Target> Joins(const ConfigurationGrid& grid, const End& end) {
  std::vector<Wave::Target> joins;
  for (ConfigurationNumber corner : end.corners.numbers()) {
    joins.push_back({corner, CostOfSteps(Distance(grid, end.places, PlacesOf(grid, corner)))});
  }
  return joins;
}

// Whether one of the ends lies in the grid cell of the other: all of its corners are the other's.
bool ShareCell(const End& a, const End& b) {
  const auto holds_all = [](const End& outer, const End& inner) {
    const auto corners = outer.corners.numbers();
    return std::all_of(inner.corners.numbers().begin(), inner.corners.numbers().end(),
                       [&](ConfigurationNumber corner) {
                         return std::find(corners.begin(), corners.end(), corner) != corners.end();
                       });
  };
  return holds_all(a, b) || holds_all(b, a);
}

// `goal` as it is reached from `before`, the waypoint before it: by the shorter way.
Configuration UnrolledGoal(const ConfigurationGrid& grid, const Configuration& before,
                           Configuration goal) {
  for (size_t j = 0; j < goal.size(); ++j) {
    if (!grid.joints()[j].continuous) continue;
    goal[j] += std::round((before[j] - goal[j]) / kTurn) * kTurn;
  }
  return goal;
}

// The grid point `at` in the turn of the grid's own range, moved to the turn of `near`.
Unrolled UnrolledCorner(const ConfigurationGrid& grid, const GridIndex& at,
                        const Configuration& near) {
  Unrolled unrolled{};
  for (size_t j = 0; j < near.size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    unrolled[j] = at[j];
    if (!joint.continuous) continue;
    const double value = joint.lower + at[j] * joint.step();
    unrolled[j] += std::llround((near[j] - value) / kTurn) * joint.steps;
  }
  return unrolled;
}

Configuration ValuesAt(const ConfigurationGrid& grid, const Unrolled& unrolled) {
  GridIndex index{};
  std::array<int64_t, kMaxJoints> turns{};
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    const int64_t steps = grid.joints()[j].steps;
    const int64_t place = (unrolled[j] % steps + steps) % steps;
    index[j] = static_cast<int>(place);
    turns[j] = (unrolled[j] - place) / steps;
  }
  Configuration q = grid.At(index);
  for (size_t j = 0; j < q.size(); ++j) q[j] += static_cast<double>(turns[j]) * kTurn;
  return q;
}

// The grid points from `from` down to a corner of the goal, without those where the path goes
// straight on if `simplify` asks for that.
std::vector<Configuration> Descent(const ConfigurationGrid& grid, const std::vector<Move>& moves,
                                   Wave& wave, ConfigurationNumber from, const End& start,
                                   const std::vector<Wave::Target>& goal_joins, bool simplify) {
  GridIndex at = *grid.IndexOf(from);
  Unrolled unrolled = UnrolledCorner(grid, at, start.configuration);
  std::vector<Configuration> waypoints = {ValuesAt(grid, unrolled)};
  const auto arrived = [&] {
    const ConfigurationNumber number = grid.NumberOf(at);
    return std::any_of(goal_joins.begin(), goal_joins.end(), [&](const Wave::Target& join) {
      return join.number == number && join.join == wave.CostAt(number);
    });
  };
  int last = -1;
  while (!arrived()) {
    const int next = wave.Descend(at, last);
    const Move& move = moves.at(static_cast<size_t>(next));
    if (!simplify || next != last) waypoints.emplace_back();
    last = next;
    at = *After(grid, at, move);
    for (size_t j = 0; j < unrolled.size(); ++j) unrolled[j] += move.steps[j];
    waypoints.back() = ValuesAt(grid, unrolled);
  }
  return waypoints;
}

// An end on a grid point stands for that point, else it is one more waypoint.
void JoinEnds(const ConfigurationGrid& grid, const End& start, const End& goal,
              std::vector<Configuration>& waypoints) {
  if (start.corners.count() == 1) {
    waypoints.front() = start.configuration;
  } else {
    waypoints.insert(waypoints.begin(), start.configuration);
  }
  const Configuration last = UnrolledGoal(grid, waypoints.back(), goal.configuration);
  if (goal.corners.count() == 1 && waypoints.size() > 1) {
    waypoints.back() = last;
  } else {
    waypoints.push_back(last);
  }
}

Plan DirectPlan(const ConfigurationGrid& grid, const End& start, const End& goal) {
  Plan plan{.outcome = PlanOutcome::kFound,
            .waypoints = {start.configuration},
            .length = Distance(grid, start.places, goal.places),
            .visited = 0};
  plan.waypoints.push_back(UnrolledGoal(grid, start.configuration, goal.configuration));
  return plan;
}

}  // namespace

std::string Describe(PlanOutcome outcome) {
  switch (outcome) {
    case PlanOutcome::kFound:
      return "a path was found";
    case PlanOutcome::kStartOutsideGrid:
      return "the start is outside the grid";
    case PlanOutcome::kGoalOutsideGrid:
      return "the goal is outside the grid";
    case PlanOutcome::kStartBlocked:
      return "the start, or a corner of its grid cell, is not free";
    case PlanOutcome::kGoalBlocked:
      return "the goal, or a corner of its grid cell, is not free";
    case PlanOutcome::kNotConnected:
      break;
  }
  return "no way leads from the start to the goal";
}

Plan PlanByWavePropagation(const ConfigurationGrid& grid, const FreeSpace& space,
                           std::span<const double> start_configuration,
                           std::span<const double> goal_configuration,
                           const PlannerOptions& options) {
  const auto without_path = [](PlanOutcome outcome) { return Plan{.outcome = outcome}; };
  const std::optional<End> start = EndAt(grid, start_configuration);
  if (!start) return without_path(PlanOutcome::kStartOutsideGrid);
  const std::optional<End> goal = EndAt(grid, goal_configuration);
  if (!goal) return without_path(PlanOutcome::kGoalOutsideGrid);

  const std::vector<Move> moves = MoveSet(grid, options.moves);
  Wave wave(grid, moves, space);
  const auto end_is_free = [&](const End& end) {
    const auto corners = end.corners.numbers();
    return std::all_of(corners.begin(), corners.end(),
                       [&](ConfigurationNumber corner) { return wave.IsFree(corner); }) &&
           (corners.size() == 1 || !space.configuration || space.configuration(end.configuration));
  };
  if (!end_is_free(*start)) return without_path(PlanOutcome::kStartBlocked);
  if (!end_is_free(*goal)) return without_path(PlanOutcome::kGoalBlocked);
  if (ShareCell(*start, *goal)) return DirectPlan(grid, *start, *goal);

  const std::vector<Wave::Target> goal_joins = Joins(grid, *goal);
  for (const Wave::Target& join : goal_joins) wave.Seed(join.number, join.join);
  const std::vector<Wave::Target> start_joins = Joins(grid, *start);
  wave.Spread(start_joins);

  Plan plan{.visited = wave.visited()};
  Cost cheapest = kUnreached;
  ConfigurationNumber from = 0;
  for (const Wave::Target& join : start_joins) {
    const Cost cost = wave.CostAt(join.number);
    if (cost == kUnreached || cost + join.join >= cheapest) continue;
    cheapest = cost + join.join;
    from = join.number;
  }
  if (cheapest == kUnreached) return plan;
  plan.outcome = PlanOutcome::kFound;
  plan.length = StepsOfCost(cheapest);
  plan.waypoints = Descent(grid, moves, wave, from, *start, goal_joins, options.simplify);
  JoinEnds(grid, *start, *goal, plan.waypoints);
  return plan;
}

}  // namespace silhouette
