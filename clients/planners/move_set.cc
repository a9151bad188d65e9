// SPDX-License-Identifier: Apache-2.0
#include "clients/planners/move_set.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <optional>

namespace silhouette {
namespace {

constexpr double kCostOfOneStep = 4294967296.0;  // 2^kCostBits

using Steps = std::array<int, kMaxJoints>;

int JointsOf(const Steps& steps) {
  return static_cast<int>(std::count_if(steps.begin(), steps.end(), [](int s) { return s != 0; }));
}

// Fewer joints first, then earlier joints, then forwards.
bool ComesBefore(const Steps& a, const Steps& b) {
  if (JointsOf(a) != JointsOf(b)) return JointsOf(a) < JointsOf(b);
  for (size_t j = 0; j < a.size(); ++j) {
    if ((a[j] != 0) != (b[j] != 0)) return a[j] != 0;
  }
  return std::lexicographical_compare(b.begin(), b.end(), a.begin(), a.end());
}

// All steps of -1, 0 and 1 along the joints that can move, of at most `joints` joints at once.
std::vector<Steps> AllSteps(const ConfigurationGrid& grid, int joints) {
  std::vector<Steps> all = {Steps{}};
  for (int j = 0; j < grid.dimensions(); ++j) {
    if (grid.joints()[static_cast<size_t>(j)].steps == 1) continue;
    const size_t count = all.size();
    for (size_t i = 0; i < count; ++i) {
      if (JointsOf(all[i]) == joints) continue;
      for (int step : {1, -1}) {
        all.push_back(all[i]);
        all.back()[static_cast<size_t>(j)] = step;
      }
    }
  }
  all.erase(all.begin());
  std::sort(all.begin(), all.end(), ComesBefore);
  return all;
}

}  // namespace

Cost CostOfSteps(double steps) { return static_cast<Cost>(std::llround(steps * kCostOfOneStep)); }

double StepsOfCost(Cost cost) { return static_cast<double>(cost) / kCostOfOneStep; }

std::vector<Move> MoveSet(const ConfigurationGrid& grid, Moves moves) {
  std::vector<Move> set;
  std::map<Steps, int> places;
  for (const Steps& steps : AllSteps(grid, moves == Moves::kAxes ? 1 : kMaxJoints)) {
    Move move{.steps = steps, .cost = CostOfSteps(std::sqrt(JointsOf(steps)))};
    for (size_t j = 0; j < steps.size(); ++j) {
      if (steps[j] == 0 || JointsOf(steps) == 1) continue;
      Steps part = steps;
      part[j] = 0;
      Steps rest{};
      rest[j] = steps[j];
      if (move.parts.empty()) move.rest = places.at(rest);
      move.parts.push_back(places.at(part));
    }
    places[steps] = static_cast<int>(set.size());
    set.push_back(std::move(move));
  }
  return set;
}

std::optional<GridIndex> After(const ConfigurationGrid& grid, const GridIndex& index,
                               const Move& move) {
  GridIndex end = index;
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    if (move.steps[j] == 0) continue;
    const GridJoint& joint = grid.joints()[j];
    end[j] += move.steps[j];
    if (joint.continuous) end[j] = (end[j] + joint.steps) % joint.steps;
    if (end[j] < 0 || end[j] >= joint.steps) return std::nullopt;
  }
  return end;
}

}  // namespace silhouette
