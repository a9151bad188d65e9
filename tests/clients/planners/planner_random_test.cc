// SPDX-License-Identifier: Apache-2.0
// The planner against a search written without any cleverness, on random grids.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <set>
#include <vector>

#include "clients/planners/wave_propagation.h"
#include "tests/random.h"

namespace silhouette {
namespace {

constexpr double kPlannerRandomTurn = 2 * std::numbers::pi;

struct Puzzle {
  ConfigurationGrid grid;
  std::vector<bool> free;  // by number
  bool operator()(ConfigurationNumber number) const { return free[number]; }
};

Puzzle RandomPuzzle(std::mt19937_64& random, int joints, int most_steps, double blocked) {
  std::vector<GridJoint> list;
  for (int j = 0; j < joints; ++j) {
    const bool continuous = random() % 2 == 0;
    const int steps = std::uniform_int_distribution<int>(continuous ? 3 : 1, most_steps)(random);
    list.push_back(
        {.name = std::to_string(j),
         .lower = -1,
         .upper = continuous ? -1 + kPlannerRandomTurn : (steps == 1 ? -1 : 0.25 * steps),
         .steps = steps,
         .continuous = continuous});
  }
  Puzzle puzzle{ConfigurationGrid(list), {}};
  std::bernoulli_distribution is_blocked(blocked);
  for (ConfigurationNumber n = 0; n < puzzle.grid.number_limit(); ++n) {
    puzzle.free.push_back(puzzle.grid.Contains(n) && !is_blocked(random));
  }
  return puzzle;
}

// All offsets of -1, 0, 1 along `joints` joints.
std::vector<GridIndex> Offsets(int joints) {
  std::vector<GridIndex> offsets = {GridIndex{}};
  for (int j = 0; j < joints; ++j) {
    std::vector<GridIndex> longer;
    for (GridIndex offset : offsets) {
      for (int step : {-1, 0, 1}) {
        offset[static_cast<size_t>(j)] = step;
        longer.push_back(offset);
      }
    }
    offsets = longer;
  }
  return offsets;
}

int JointsOf(const GridIndex& offset) {
  int joints = 0;
  for (int step : offset) joints += step != 0 ? 1 : 0;
  return joints;
}

std::optional<GridIndex> Moved(const ConfigurationGrid& grid, GridIndex index,
                               const GridIndex& offset) {
  for (int j = 0; j < grid.dimensions(); ++j) {
    const std::optional<GridIndex> next = grid.Neighbour(index, j, offset[static_cast<size_t>(j)]);
    if (!next) return std::nullopt;
    index = *next;
  }
  return index;
}

// Whether every grid point of the box between `index` and `index` + `offset` is free.
bool BoxIsFree(const Puzzle& puzzle, const GridIndex& index, const GridIndex& offset) {
  for (int choice = 0; choice < (1 << kMaxJoints); ++choice) {
    GridIndex part{};
    for (size_t j = 0; j < part.size(); ++j) part[j] = (choice >> j) % 2 == 1 ? offset[j] : 0;
    const std::optional<GridIndex> at = Moved(puzzle.grid, index, part);
    if (!at || !puzzle.free[puzzle.grid.NumberOf(*at)]) return false;
  }
  return true;
}

// Length of the shortest path between two free grid points, by relaxing every move again and again;
// infinite if there is none.
double ShortestLength(const Puzzle& puzzle, ConfigurationNumber start, ConfigurationNumber goal,
                      Moves moves) {
  std::vector<double> length(puzzle.free.size(), std::numeric_limits<double>::infinity());
  length[start] = 0;
  const std::vector<GridIndex> offsets = Offsets(puzzle.grid.dimensions());
  std::set<ConfigurationNumber> open = {start};
  while (!open.empty()) {
    const ConfigurationNumber number = *open.begin();
    open.erase(open.begin());
    const GridIndex index = puzzle.grid.IndexOf(number).value();
    for (const GridIndex& offset : offsets) {
      const int joints = JointsOf(offset);
      if (joints == 0 || (moves == Moves::kAxes && joints > 1)) continue;
      if (!BoxIsFree(puzzle, index, offset)) continue;
      const ConfigurationNumber next = puzzle.grid.NumberOf(*Moved(puzzle.grid, index, offset));
      if (length[number] + std::sqrt(joints) < length[next] - 1e-9) {
        length[next] = length[number] + std::sqrt(joints);
        open.insert(next);
      }
    }
  }
  return length[goal];
}

// The move from one waypoint to the next in grid steps; fails the test if it is not one.
GridIndex OffsetBetween(const ConfigurationGrid& grid, const Configuration& from,
                        const Configuration& to) {
  GridIndex offset{};
  for (size_t j = 0; j < from.size(); ++j) {
    const double step = grid.joints()[j].step();
    const double steps = step > 0 ? (to[j] - from[j]) / step : to[j] - from[j];
    offset[j] = static_cast<int>(std::lround(steps));
    EXPECT_NEAR(steps, offset[j], 1e-6);
    EXPECT_LE(std::abs(offset[j]), 1);
  }
  return offset;
}

// Walks the path move by move; returns its length.
double WalkedLength(const Puzzle& puzzle, const std::vector<Configuration>& waypoints) {
  double length = 0;
  for (size_t i = 0; i + 1 < waypoints.size(); ++i) {
    const GridIndex offset = OffsetBetween(puzzle.grid, waypoints[i], waypoints[i + 1]);
    const GridIndex at = puzzle.grid.IndexOf(puzzle.grid.Nearest(waypoints[i]).value()).value();
    EXPECT_TRUE(BoxIsFree(puzzle, at, offset)) << "waypoint " << i;
    length += std::sqrt(JointsOf(offset));
  }
  return length;
}

ConfigurationNumber RandomFree(const Puzzle& puzzle, std::mt19937_64& random) {
  for (;;) {
    const ConfigurationNumber number = random() % puzzle.free.size();
    if (puzzle.free[number]) return number;
  }
}

class RandomPlans : public testing::TestWithParam<Moves> {};

TEST_P(RandomPlans, AreAsShortAsTheBruteForceSaysAndTouchOnlyFreePoints) {
  Random random;
  int found = 0;
  int not_connected = 0;
  for (int round = 0; round < 120; ++round) {
    const int joints = 1 + round % 4;
    const int most_steps = joints == 1 ? 40 : joints == 2 ? 12 : joints == 3 ? 6 : 4;
    const Puzzle puzzle = RandomPuzzle(random, joints, most_steps, 0.1 * (round % 5));
    if (std::count(puzzle.free.begin(), puzzle.free.end(), true) == 0) continue;
    const ConfigurationNumber start = RandomFree(puzzle, random);
    const ConfigurationNumber goal = RandomFree(puzzle, random);
    const Plan plan =
        PlanByWavePropagation(puzzle.grid, {.point = std::cref(puzzle)}, puzzle.grid.At(start),
                              puzzle.grid.At(goal), {.moves = GetParam(), .simplify = false});
    const double expected = ShortestLength(puzzle, start, goal, GetParam());
    if (!std::isfinite(expected)) {
      EXPECT_EQ(plan.outcome, PlanOutcome::kNotConnected);
      ++not_connected;
      continue;
    }
    ++found;
    ASSERT_TRUE(plan.found());
    EXPECT_NEAR(plan.length, expected, 1e-6);
    EXPECT_NEAR(WalkedLength(puzzle, plan.waypoints), expected, 1e-6);
    EXPECT_EQ(puzzle.grid.Nearest(plan.waypoints.front()), start);
    EXPECT_EQ(puzzle.grid.Nearest(plan.waypoints.back()), goal);
  }
  EXPECT_GT(found, 20);
  EXPECT_GT(not_connected, 3);
}

TEST_P(RandomPlans, SimplifiedOnesPassTheSamePoints) {
  Random random;
  for (int round = 0; round < 40; ++round) {
    const Puzzle puzzle = RandomPuzzle(random, 2, 15, 0.2);
    if (std::count(puzzle.free.begin(), puzzle.free.end(), true) == 0) continue;
    const Configuration start = puzzle.grid.At(RandomFree(puzzle, random));
    const Configuration goal = puzzle.grid.At(RandomFree(puzzle, random));
    const auto find = [&](bool simplify) {
      return PlanByWavePropagation(puzzle.grid, {.point = std::cref(puzzle)}, start, goal,
                                   {.moves = GetParam(), .simplify = simplify});
    };
    const Plan full = find(false);
    const Plan simple = find(true);
    ASSERT_EQ(full.outcome, simple.outcome);
    EXPECT_LE(simple.waypoints.size(), full.waypoints.size());
    size_t next = 0;  // in `full`
    for (size_t i = 0; i + 1 < simple.waypoints.size(); ++i) {
      const Configuration& from = simple.waypoints[i];
      const Configuration& to = simple.waypoints[i + 1];
      int steps = 1;
      for (size_t j = 0; j < from.size(); ++j) {
        const double step = puzzle.grid.joints()[j].step();
        if (step > 0) steps = std::max<int>(steps, std::lround(std::abs(to[j] - from[j]) / step));
      }
      for (int k = 0; k < steps; ++k, ++next) {
        ASSERT_LT(next, full.waypoints.size());
        for (size_t j = 0; j < from.size(); ++j) {
          EXPECT_NEAR(full.waypoints[next][j], from[j] + (to[j] - from[j]) * k / steps, 1e-9);
        }
      }
    }
    if (full.found() && full.length > 0) {
      EXPECT_EQ(next + 1, full.waypoints.size());
    }
  }
}

TEST_P(RandomPlans, NeverMakeABlockedMove) {
  Random random;
  int found = 0;
  for (int round = 0; round < 60; ++round) {
    const Puzzle puzzle = RandomPuzzle(random, 2 + round % 2, 8, 0.1);
    if (std::count(puzzle.free.begin(), puzzle.free.end(), true) == 0) continue;
    const auto move = [](ConfigurationNumber a, ConfigurationNumber b) { return (a ^ b) % 5 != 0; };
    const Plan plan = PlanByWavePropagation(puzzle.grid, {.point = std::cref(puzzle), .move = move},
                                            puzzle.grid.At(RandomFree(puzzle, random)),
                                            puzzle.grid.At(RandomFree(puzzle, random)),
                                            {.moves = GetParam(), .simplify = false});
    if (!plan.found()) continue;
    ++found;
    EXPECT_NEAR(WalkedLength(puzzle, plan.waypoints), plan.length, 1e-6);
    if (plan.length == 0) continue;
    for (size_t i = 0; i + 1 < plan.waypoints.size(); ++i) {
      EXPECT_TRUE(move(puzzle.grid.Nearest(plan.waypoints[i]).value(),
                       puzzle.grid.Nearest(plan.waypoints[i + 1]).value()));
    }
  }
  EXPECT_GT(found, 5);
}

TEST_P(RandomPlans, AreTheSameEveryTime) {
  Random random;
  const Puzzle puzzle = RandomPuzzle(random, 3, 8, 0.1);
  const Configuration start = puzzle.grid.At(RandomFree(puzzle, random));
  const Configuration goal = puzzle.grid.At(RandomFree(puzzle, random));
  const auto find = [&] {
    return PlanByWavePropagation(puzzle.grid, {.point = std::cref(puzzle)}, start, goal,
                                 {.moves = GetParam()});
  };
  const Plan first = find();
  for (int i = 0; i < 5; ++i) EXPECT_EQ(find().waypoints, first.waypoints);
}

// What CheckPath of the server asks: every place between two waypoints lies in a grid cell whose
// corners are all free.
TEST_P(RandomPlans, BetweenEndsOffTheGridPassOnlyThroughFreeCells) {
  Random random;
  int found = 0;
  for (int round = 0; round < 200; ++round) {
    const Puzzle puzzle = RandomPuzzle(random, 1 + round % 3, 10, 0.1);
    const auto random_place = [&] {
      Configuration q;
      for (const GridJoint& joint : puzzle.grid.joints()) {
        q.push_back(joint.steps == 1
                        ? joint.lower
                        : std::uniform_real_distribution<double>(joint.lower, joint.upper)(random));
      }
      return q;
    };
    const Configuration start = random_place();
    const Configuration goal = random_place();
    const Plan plan = PlanByWavePropagation(puzzle.grid, {.point = std::cref(puzzle)}, start, goal,
                                            {.moves = GetParam()});
    if (!plan.found()) continue;
    ++found;
    ASSERT_EQ(plan.waypoints.front(), start);
    for (size_t j = 0; j < goal.size(); ++j) {
      EXPECT_NEAR(std::remainder(plan.waypoints.back()[j] - goal[j], kPlannerRandomTurn), 0, 1e-9);
    }
    for (size_t i = 0; i + 1 < plan.waypoints.size(); ++i) {
      for (int k = 0; k <= 50; ++k) {
        Configuration q = plan.waypoints[i];
        for (size_t j = 0; j < q.size(); ++j) {
          q[j] += (plan.waypoints[i + 1][j] - q[j]) * k / 50;
        }
        const CellCorners corners = puzzle.grid.CornersAround(q);
        ASSERT_GT(corners.count(), 0);
        for (ConfigurationNumber corner : corners.numbers()) {
          EXPECT_TRUE(puzzle.free[corner]) << "round " << round << ", waypoint " << i;
        }
      }
    }
  }
  EXPECT_GT(found, 10);
}

INSTANTIATE_TEST_SUITE_P(BothKindsOfMoves, RandomPlans,
                         testing::Values(Moves::kAxes, Moves::kDiagonals), [](const auto& tested) {
                           return tested.param == Moves::kAxes ? "Axes" : "Diagonals";
                         });

}  // namespace
}  // namespace silhouette
