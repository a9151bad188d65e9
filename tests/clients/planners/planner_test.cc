// SPDX-License-Identifier: Apache-2.0
// What the planner promises, on grids small enough to draw.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/planners/wave_propagation.h"

namespace silhouette {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::IsEmpty;

constexpr double kPlannerTurn = 2 * std::numbers::pi;

// A map of two joints with steps of 1: a row per value of joint a, a column per value of joint b,
// '#' not free.
struct Map {
  explicit Map(std::vector<std::string> drawn)
      : rows(std::move(drawn)),
        grid({{.name = "a", .lower = 0, .upper = Last(rows.size()), .steps = Steps(rows.size())},
              {.name = "b",
               .lower = 0,
               .upper = Last(rows[0].size()),
               .steps = Steps(rows[0].size())}}) {}

  static double Last(size_t count) { return static_cast<double>(count) - 1; }
  static int Steps(size_t count) { return static_cast<int>(count); }

  std::function<bool(ConfigurationNumber)> Free() const {
    return [this](ConfigurationNumber number) {
      const GridIndex index = grid.IndexOf(number).value();
      return rows[static_cast<size_t>(index[0])][static_cast<size_t>(index[1])] != '#';
    };
  }

  Plan Find(const Configuration& start, const Configuration& goal,
            const PlannerOptions& options) const {
    return PlanByWavePropagation(grid, {.point = Free()}, start, goal, options);
  }

  std::vector<std::string> rows;
  ConfigurationGrid grid;
};

TEST(Planner, LeadsAroundAnObstacle) {
  const Map map({"....",  //
                 ".##.",  //
                 "...."});
  const Plan plan = map.Find({1, 0}, {1, 3}, {.moves = Moves::kAxes, .simplify = false});
  ASSERT_EQ(plan.outcome, PlanOutcome::kFound);
  EXPECT_EQ(plan.length, 5);
  EXPECT_THAT(plan.waypoints,
              ElementsAre(Configuration{1, 0}, Configuration{2, 0}, Configuration{2, 1},
                          Configuration{2, 2}, Configuration{2, 3}, Configuration{1, 3}));
}

TEST(Planner, SimplifiedPathKeepsOnlyTheTurns) {
  const Map map({"....",  //
                 ".##.",  //
                 "...."});
  const Plan plan = map.Find({1, 0}, {1, 3}, {.moves = Moves::kAxes, .simplify = true});
  EXPECT_EQ(plan.length, 5);
  EXPECT_THAT(plan.waypoints, ElementsAre(Configuration{1, 0}, Configuration{2, 0},
                                          Configuration{2, 3}, Configuration{1, 3}));
}

TEST(Planner, DiagonalIsShorterWhereNothingIsCut) {
  const Map map({"...",  //
                 "...",  //
                 "..."});
  const Plan plan = map.Find({0, 0}, {2, 2}, {.moves = Moves::kDiagonals});
  EXPECT_NEAR(plan.length, 2 * std::numbers::sqrt2, 1e-6);
  EXPECT_THAT(plan.waypoints, ElementsAre(Configuration{0, 0}, Configuration{2, 2}));
}

TEST(Planner, DiagonalNeverCutsACorner) {
  const Map map({".#",  //
                 ".."});
  const Plan plan = map.Find({0, 0}, {1, 1}, {.moves = Moves::kDiagonals, .simplify = false});
  EXPECT_EQ(plan.length, 2);
  EXPECT_THAT(plan.waypoints,
              ElementsAre(Configuration{0, 0}, Configuration{1, 0}, Configuration{1, 1}));
  const Map between({".#",  //
                     "#."});
  EXPECT_EQ(between.Find({0, 0}, {1, 1}, {.moves = Moves::kDiagonals}).outcome,
            PlanOutcome::kNotConnected);
}

TEST(Planner, DiagonalOfThreeJointsNeedsItsWholeBox) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 2},
                                {.name = "b", .lower = 0, .upper = 1, .steps = 2},
                                {.name = "c", .lower = 0, .upper = 1, .steps = 2}});
  for (ConfigurationNumber blocked = 0; blocked < grid.number_limit(); ++blocked) {
    if (!grid.Contains(blocked)) continue;
    const Configuration q = grid.At(blocked);
    const auto is_free = [&](ConfigurationNumber number) { return number != blocked; };
    const Plan plan = PlanByWavePropagation(grid, {.point = is_free}, Configuration{0, 0, 0},
                                            Configuration{1, 1, 1}, {.moves = Moves::kDiagonals});
    if (q == Configuration{0, 0, 0} || q == Configuration{1, 1, 1}) {
      EXPECT_FALSE(plan.found());
    } else {
      EXPECT_NEAR(plan.length, 1 + std::numbers::sqrt2, 1e-6);
    }
  }
}

TEST(Planner, ContinuousJointTakesTheShortWayAndGoesOnBeyondTheTurn) {
  const ConfigurationGrid grid(
      {{.name = "a", .lower = 0, .upper = kPlannerTurn, .steps = 8, .continuous = true}});
  const auto all = [](ConfigurationNumber) { return true; };
  const Configuration start = {6 * kPlannerTurn / 8};
  const Configuration goal = {1 * kPlannerTurn / 8};
  const Plan plan = PlanByWavePropagation(grid, {.point = all}, start, goal, {});
  EXPECT_EQ(plan.length, 3);
  EXPECT_THAT(plan.waypoints, ElementsAre(ElementsAreArray(start),
                                          ElementsAre(DoubleNear(9 * kPlannerTurn / 8, 1e-12))));
  // The other way round it goes below the lower limit.
  const Plan back = PlanByWavePropagation(grid, {.point = all}, goal, start, {});
  EXPECT_THAT(back.waypoints, ElementsAre(ElementsAreArray(goal),
                                          ElementsAre(DoubleNear(-2 * kPlannerTurn / 8, 1e-12))));
}

TEST(Planner, StartSomeTurnsAwayStaysThere) {
  const ConfigurationGrid grid(
      {{.name = "a", .lower = 0, .upper = kPlannerTurn, .steps = 8, .continuous = true}});
  const Configuration start = {-3 * kPlannerTurn + 0.1};
  const Plan plan = PlanByWavePropagation(grid, {.point = [](ConfigurationNumber) { return true; }},
                                          start, Configuration{kPlannerTurn / 2}, {});
  ASSERT_TRUE(plan.found());
  EXPECT_EQ(plan.waypoints.front(), start);
  EXPECT_NEAR(plan.waypoints.back()[0], -2.5 * kPlannerTurn, 1e-9);
}

TEST(Planner, EndsOffTheGridAreJoinedToTheNearestUsefulCorner) {
  const Map map({".....",  //
                 "....."});
  const Plan plan = map.Find({0.25, 0.5}, {0.25, 3.5}, {.moves = Moves::kAxes});
  ASSERT_TRUE(plan.found());
  EXPECT_THAT(plan.waypoints, ElementsAre(Configuration{0.25, 0.5}, Configuration{0, 1},
                                          Configuration{0, 3}, Configuration{0.25, 3.5}));
  EXPECT_NEAR(plan.length, 2 + 2 * std::hypot(0.25, 0.5), 1e-6);
}

TEST(Planner, EndsInOneGridCellAreJoinedDirectly) {
  const Map map({"...",  //
                 "...",  //
                 "###"});
  const Plan plan = map.Find({0.2, 0.2}, {0.8, 0.7}, {});
  EXPECT_THAT(plan.waypoints, ElementsAre(Configuration{0.2, 0.2}, Configuration{0.8, 0.7}));
  EXPECT_NEAR(plan.length, std::hypot(0.6, 0.5), 1e-6);
  // A grid point and a place in a cell that it belongs to.
  EXPECT_EQ(map.Find({0, 1}, {0.5, 1.5}, {}).waypoints.size(), 2u);
}

TEST(Planner, OppositeCornersOfACellAreNotJoinedAcrossABlockedOne) {
  const Map map({".#",  //
                 ".."});
  EXPECT_EQ(map.Find({0, 0}, {1, 1}, {}).waypoints.size(), 3u);
}

TEST(Planner, OneBlockedCornerBlocksAnEndOffTheGrid) {
  const Map map({"....",  //
                 "...#"});
  EXPECT_EQ(map.Find({0.5, 2.5}, {0, 0}, {}).outcome, PlanOutcome::kStartBlocked);
  EXPECT_EQ(map.Find({0, 0}, {0.5, 2.5}, {}).outcome, PlanOutcome::kGoalBlocked);
  EXPECT_EQ(map.Find({0, 2.5}, {0, 0}, {}).outcome, PlanOutcome::kFound) << "only two corners";
}

TEST(Planner, EndOffTheGridMustItselfBeFree) {
  const Map map({"....",  //
                 "...."});
  const Configuration blocked = {0.5, 2.5};
  const auto is_free = [&](std::span<const double> q) {
    return !std::equal(q.begin(), q.end(), blocked.begin(), blocked.end());
  };
  const Configuration corner = {0, 0};
  EXPECT_EQ(PlanByWavePropagation(map.grid, {.point = map.Free(), .configuration = is_free},
                                  blocked, corner)
                .outcome,
            PlanOutcome::kStartBlocked);
  EXPECT_EQ(PlanByWavePropagation(map.grid, {.point = map.Free(), .configuration = is_free}, corner,
                                  blocked)
                .outcome,
            PlanOutcome::kGoalBlocked);
  EXPECT_TRUE(PlanByWavePropagation(map.grid, {.point = map.Free(), .configuration = is_free},
                                    corner, Configuration{0.5, 1.5})
                  .found());
}

TEST(Planner, WithoutAPathItSaysWhy) {
  const Map map({"..#.",  //
                 "..#."});
  EXPECT_EQ(map.Find({0, 2}, {0, 0}, {}).outcome, PlanOutcome::kStartBlocked);
  EXPECT_EQ(map.Find({0, 0}, {0, 2}, {}).outcome, PlanOutcome::kGoalBlocked);
  EXPECT_EQ(map.Find({0, -1}, {0, 0}, {}).outcome, PlanOutcome::kStartOutsideGrid);
  EXPECT_EQ(map.Find({0, 0}, {0, 9}, {}).outcome, PlanOutcome::kGoalOutsideGrid);
  EXPECT_EQ(map.Find({0}, {0, 0}, {}).outcome, PlanOutcome::kStartOutsideGrid);
  EXPECT_EQ(map.Find({0, 0}, {0, std::nan("")}, {}).outcome, PlanOutcome::kGoalOutsideGrid);
  const Plan plan = map.Find({0, 0}, {0, 3}, {});
  EXPECT_EQ(plan.outcome, PlanOutcome::kNotConnected);
  EXPECT_THAT(plan.waypoints, IsEmpty());
  EXPECT_EQ(plan.visited, 2u) << "the wave from the goal";
}

TEST(Planner, NothingDecidedIsNoPath) {
  EXPECT_FALSE(Plan().found());
  EXPECT_THAT(Plan().waypoints, IsEmpty());
}

TEST(Planner, StartThatIsTheGoalNeedsNoMove) {
  const Map map({"..."});
  const Plan plan = map.Find({0, 1}, {0, 1}, {});
  ASSERT_TRUE(plan.found());
  EXPECT_EQ(plan.length, 0);
  EXPECT_THAT(plan.waypoints, ElementsAre(Configuration{0, 1}, Configuration{0, 1}));
}

TEST(Planner, AsksForEachGridPointAtMostOnce) {
  const Map map({"......",  //
                 ".####.",  //
                 "......"});
  std::map<ConfigurationNumber, int> asked;
  const auto is_free = [&](ConfigurationNumber number) {
    ++asked[number];
    return map.Free()(number);
  };
  PlanByWavePropagation(map.grid, {.point = is_free}, Configuration{1, 0}, Configuration{1, 5},
                        {.moves = Moves::kDiagonals});
  for (const auto& [number, times] : asked) EXPECT_EQ(times, 1) << number;
}

TEST(Planner, BlockedMoveIsNotMadeThoughBothItsEndsAreFree) {
  const Map map({"..",  //
                 ".."});
  const ConfigurationNumber a = map.grid.NumberOf({0, 0});
  const ConfigurationNumber b = map.grid.NumberOf({0, 1});
  FreeSpace space{.point = map.Free()};
  space.move = [&](ConfigurationNumber from, ConfigurationNumber to) {
    return !(from == a && to == b) && !(from == b && to == a);
  };
  const auto length = [&](const Configuration& start, const Configuration& goal) {
    return PlanByWavePropagation(map.grid, space, start, goal, {.moves = Moves::kAxes}).length;
  };
  EXPECT_EQ(length({0, 0}, {0, 1}), 3);
  EXPECT_EQ(length({0, 1}, {0, 0}), 3);
  EXPECT_EQ(length({1, 0}, {1, 1}), 1);
}

TEST(Planner, VisitsOnlyTheNeighbourhoodOfAShortPath) {
  std::vector<GridJoint> joints;
  for (const char* name : {"a", "b", "c", "d", "e", "f", "g"}) {
    joints.push_back({.name = name, .lower = 0, .upper = 49, .steps = 50});
  }
  const ConfigurationGrid grid(joints);  // 8e11 configurations
  const Configuration start(7, 20.0);
  Configuration goal = start;
  goal[6] = 22;
  goal[0] = 19;
  const Plan plan =
      PlanByWavePropagation(grid, {.point = [](ConfigurationNumber) { return true; }}, start, goal);
  EXPECT_EQ(plan.length, 3);
  EXPECT_LT(plan.visited, 1000u);
}

}  // namespace
}  // namespace silhouette
