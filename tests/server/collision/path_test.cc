// SPDX-License-Identifier: Apache-2.0
// Paths: nothing between the tested places is left out.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "db/mask/segment_places.h"
#include "server/collision/collision_checker.h"
#include "tests/random.h"
#include "tests/server/collision/random_cell.h"

namespace silhouette {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

// A robot that is a point at its configuration, seen by one view with a pixel per configuration:
// whatever set of grid points is wanted can be made occupied.
struct PointCell {
  ConfigurationGrid grid;
  RobotImageTable table;
  ObstacleImages images;

  // `occupied(a, b)`: whether the grid point is.
  PointCell(ConfigurationGrid the_grid, const std::function<bool(int a, int b)>& occupied)
      : grid(the_grid), table(Table(the_grid)) {
    const MaskSize size = table.mask_sizes()[0];
    images.push_back(ObstacleImage::FromScene(Mask::FromPredicate(size, occupied), Mask(size)));
  }

  static RobotImageTable Table(const ConfigurationGrid& grid) {
    const MaskSize size{grid.joints()[0].steps, grid.joints()[1].steps};
    RobotImageTable::Builder builder(grid, {size});
    for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
      if (const auto index = grid.IndexOf(number)) {
        builder.Add(number, std::vector<Mask>{Mask::FromPredicate(size, [&](int x, int y) {
                      return x == (*index)[0] && y == (*index)[1];
                    })});
      }
    }
    return std::move(builder).Build();
  }

  PathVerdict Check(const std::vector<Configuration>& waypoints,
                    OffGrid off_grid = OffGrid::kCell) const {
    return CollisionChecker(table, images, {.off_grid = off_grid}).CheckPath(waypoints);
  }
};

ConfigurationGrid UnitGrid(int steps_a, int steps_b) {
  return ConfigurationGrid({{.name = "a", .lower = 0, .upper = steps_a - 1.0, .steps = steps_a},
                            {.name = "b", .lower = 0, .upper = steps_b - 1.0, .steps = steps_b}});
}

ConfigurationGrid TurningGrid() {
  return ConfigurationGrid(
      {{.name = "a", .lower = 0, .upper = kTurn, .steps = 12, .continuous = true},
       {.name = "b", .lower = -2, .upper = 3, .steps = 6}});
}

TEST(CheckPath, OneWaypointIsOnePlace) {
  const PointCell cell(UnitGrid(4, 4), [](int a, int b) { return a == 1 && b == 1; });
  const PathVerdict free = cell.Check({{3, 3}});
  EXPECT_TRUE(free.verdict.free());
  EXPECT_EQ(free.checked, 1);
  const PathVerdict occupied = cell.Check({{1, 1}});
  EXPECT_EQ(occupied.verdict.state(), State::kOccupied);
  EXPECT_EQ(occupied.segment, 0);
  EXPECT_EQ(occupied.fraction, 0);
  EXPECT_EQ(occupied.configuration, (Configuration{1, 1}));
}

TEST(CheckPath, FindsTheCellThatOnlyACornerOfThePathCuts) {
  // The line from (0, 0.999) to (3, 1.002) enters the row of cells above b = 1 close to a = 1.
  const PointCell cell(UnitGrid(4, 4), [](int a, int b) { return a == 2 && b == 2; });
  const PathVerdict verdict = cell.Check({{0, 0.999}, {3, 1.002}});
  EXPECT_EQ(verdict.verdict.state(), State::kOccupied);
  EXPECT_EQ(verdict.segment, 0);
  EXPECT_GT(verdict.configuration[0], 1);
  EXPECT_GT(verdict.configuration[1], 1);
}

TEST(CheckPath, LineAlongGridValuesTestsOnlyTheGridPointsOnIt) {
  const PointCell cell(UnitGrid(5, 4), [](int, int b) { return b != 1; });
  EXPECT_TRUE(cell.Check({{0, 1}, {4, 1}}).verdict.free());
  EXPECT_FALSE(cell.Check({{0, 1}, {4, 1.01}}).verdict.free());
}

TEST(CheckPath, DiagonalThroughGridPointsTestsTheCellsItCrossesAndNoOthers) {
  // Points off the cells' diagonal band: (2, 0) and (0, 2) belong to no cell on the way.
  const PointCell beside(UnitGrid(4, 4), [](int a, int b) { return std::abs(a - b) > 1; });
  EXPECT_TRUE(beside.Check({{0, 0}, {3, 3}}).verdict.free());
  const PointCell corner(UnitGrid(4, 4), [](int a, int b) { return a == 3 && b == 2; });
  EXPECT_FALSE(corner.Check({{0, 0}, {3, 3}}).verdict.free());
}

TEST(CheckPath, TellsWaypointFractionAndPlace) {
  const PointCell cell(UnitGrid(6, 3), [](int a, int) { return a >= 4; });
  const PathVerdict verdict = cell.Check({{0, 0}, {1, 0}, {1, 1}, {5, 1}});
  EXPECT_EQ(verdict.verdict.state(), State::kOccupied);
  EXPECT_EQ(verdict.segment, 2);
  // Somewhere in the cell between a = 3 and a = 4, half and three quarters of the way.
  EXPECT_GT(verdict.fraction, 0.5);
  EXPECT_LT(verdict.fraction, 0.75);
  EXPECT_NEAR(verdict.configuration[0], 1 + 4 * verdict.fraction, 1e-12);
  EXPECT_EQ(verdict.configuration[1], 1);
}

TEST(CheckPath, ContinuousJointGoesTheWayThatItsValuesSay) {
  // Points 5 to 7 of the turn are occupied: forward from 1 to 11 meets them, backward does not.
  const PointCell cell(TurningGrid(), [](int a, int) { return 5 <= a && a <= 7; });
  const double step = kTurn / 12;
  EXPECT_FALSE(cell.Check({{1 * step, 0}, {11 * step, 0}}).verdict.free());
  EXPECT_TRUE(cell.Check({{1 * step, 0}, {-1 * step, 0}}).verdict.free());
  EXPECT_TRUE(cell.Check({{13 * step, 0}, {11 * step, 0}}).verdict.free());
  EXPECT_FALSE(cell.Check({{1 * step, 0}, {13 * step, 0}}).verdict.free()) << "a whole turn";
  EXPECT_TRUE(cell.Check({{35 * step, 0}, {39 * step, 0}}).verdict.free()) << "turns away";
}

TEST(CheckPath, PathThatLeavesTheGridIsNeverFree) {
  const PointCell cell(UnitGrid(4, 4), [](int, int) { return false; });
  for (OffGrid off_grid : {OffGrid::kCell, OffGrid::kNearest}) {
    ASSERT_TRUE(cell.Check({{0, 0}, {3, 3}}, off_grid).verdict.free());
    const PathVerdict out = cell.Check({{2.8, 1}, {3.2, 1}, {2, 1}}, off_grid);
    EXPECT_EQ(out.verdict, Verdict::Unknown(Reason::kOutsideGrid));
    EXPECT_EQ(out.segment, 0);
    EXPECT_GT(out.fraction, 0.5) << "the grid ends half-way";
    for (const Configuration& q : std::vector<Configuration>{
             {std::nan(""), 0}, {0, INFINITY}, {0}, {1, 1, 1}, {1e308, 0}, {-1e300, 2}}) {
      EXPECT_EQ(cell.Check({{1, 1}, q, {2, 2}}, off_grid).verdict,
                Verdict::Unknown(Reason::kOutsideGrid));
      EXPECT_EQ(cell.Check({q, {2, 2}}, off_grid).verdict, Verdict::Unknown(Reason::kOutsideGrid));
    }
  }
}

TEST(CheckPath, JointWithOneValueThatMovesLeavesTheGridAtOnce) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 3, .steps = 4},
                                {.name = "b", .lower = 1, .upper = 1, .steps = 1}});
  const PointCell cell(grid, [](int, int) { return false; });
  EXPECT_TRUE(cell.Check({{0, 1}, {3, 1}}).verdict.free());
  const PathVerdict out = cell.Check({{0, 1}, {3, 1.5}});
  EXPECT_EQ(out.verdict, Verdict::Unknown(Reason::kOutsideGrid));
  EXPECT_LT(out.fraction, 0.5);
  EXPECT_FALSE(cell.Check({{2, 1}, {2, 1.5}}).verdict.free());
}

TEST(CheckPath, ContinuousJointTooManyTurnsAwayIsNeverFree) {
  const PointCell cell(TurningGrid(), [](int, int) { return false; });
  EXPECT_EQ(cell.Check({{0, 0}, {1e15, 0}}).verdict, Verdict::Unknown(Reason::kOutsideGrid));
  EXPECT_EQ(cell.Check({{0, 0}, {1e308, 0}}).verdict, Verdict::Unknown(Reason::kOutsideGrid));
}

TEST(CheckPath, WithoutWaypointsIsRefused) {
  const PointCell cell(UnitGrid(4, 4), [](int, int) { return false; });
  EXPECT_THROW(cell.Check({}), std::invalid_argument);
}

TEST(CheckPath, HiddenPossibleAnywhereIsTold) {
  PointCell cell(UnitGrid(4, 4), [](int, int) { return false; });
  const Mask robot = Mask::FromPredicate({4, 4}, [](int a, int) { return a == 2; });
  cell.images = {ObstacleImage::FromScene(robot, robot)};
  EXPECT_EQ(cell.Check({{0, 0}, {3, 0}}).verdict, Verdict::Free(true));
  EXPECT_EQ(cell.Check({{0, 0}, {1, 0}}).verdict, Verdict::Free(false));
}

struct RandomPaths : ::testing::TestWithParam<OffGrid> {
  Random random;
};

// The place at waypoint number plus fraction of the way to the next one.
Configuration OnPath(const std::vector<Configuration>& waypoints, double at) {
  const size_t segment = std::min(static_cast<size_t>(at), waypoints.size() - 2);
  Configuration q = waypoints[segment];
  for (size_t j = 0; j < q.size(); ++j) {
    q[j] += (at - static_cast<double>(segment)) * (waypoints[segment + 1][j] - q[j]);
  }
  return q;
}

// A sample close to where the verdict may change is left to rounding.
bool NearACrossing(const ConfigurationGrid& grid, const Configuration& q, OffGrid off_grid) {
  for (int j = 0; j < grid.dimensions(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    const double place =
        (q[j] - joint.lower) / joint.step() + (off_grid == OffGrid::kCell ? 0 : 0.5);
    if (std::abs(place - std::round(place)) < 1e-5) return true;
  }
  return false;
}

TEST_P(RandomPaths, ExactTraversalFindsWhatDenseSamplesFindAndNothingElse) {
  std::uniform_real_distribution<double> a(-8, 14), b(-2, 3);
  int free_paths = 0;
  for (int round = 0; round < 150; ++round) {
    std::bernoulli_distribution blocked(0.06);
    const PointCell cell(TurningGrid(), [&](int, int) { return blocked(random); });
    const CollisionChecker test(cell.table, cell.images, {.off_grid = GetParam()});
    std::vector<Configuration> waypoints;
    for (int i = 0; i < 3; ++i) {
      waypoints.push_back(
          {waypoints.empty() ? a(random) : waypoints.back()[0] + a(random) / 8, b(random)});
    }
    const PathVerdict exact = test.CheckPath(waypoints);
    const auto not_free_at = [&](double at) {
      const Configuration q = OnPath(waypoints, at);
      return !NearACrossing(cell.grid, q, GetParam()) && !test.Check(q).free();
    };
    std::optional<double> first;
    for (int i = 0; i <= 6000 && !first; ++i) {
      if (not_free_at(i / 3000.0)) first = i / 3000.0;
    }
    if (exact.verdict.free()) {
      ++free_paths;
      EXPECT_FALSE(first) << "a sample at " << *first << " is not free";
      continue;
    }
    EXPECT_EQ(test.Check(exact.configuration), exact.verdict);
    // From the first sample that is not free up to the place told nothing is free: no part of the
    // path that is not free comes before that of the place told.
    const double place = exact.segment + exact.fraction;
    for (double at = first.value_or(place); at < place; at += 1e-4) {
      EXPECT_TRUE(not_free_at(at) || NearACrossing(cell.grid, OnPath(waypoints, at), GetParam()));
    }
  }
  EXPECT_GT(free_paths, 5);
  EXPECT_LT(free_paths, 145);
}

INSTANTIATE_TEST_SUITE_P(BothRules, RandomPaths,
                         ::testing::Values(OffGrid::kCell, OffGrid::kNearest),
                         [](const auto& param_info) {
                           return param_info.param == OffGrid::kCell ? "Cell" : "Nearest";
                         });

TEST(SegmentPlaces, AreTheCrossingsAndOnePlaceBetweenEachTwo) {
  const ConfigurationGrid grid = UnitGrid(5, 5);
  const Configuration from = {0.5, 1};
  const Configuration to = {2.5, 1};
  std::vector<double> cell, nearest;
  SegmentPlaces crossing(grid, from, to, SegmentPlaces::Border::kGridValues);
  while (const auto place = crossing.Next()) cell.push_back(*place);
  EXPECT_EQ(cell, (std::vector<double>{0.125, 0.25, 0.5, 0.75, 0.875}));
  SegmentPlaces half_way(grid, {{0.75, 1.0}}, {{2.75, 1.0}}, SegmentPlaces::Border::kHalfWay);
  while (const auto place = half_way.Next()) nearest.push_back(*place);
  EXPECT_EQ(nearest, (std::vector<double>{0.1875, 0.375, 0.625, 0.875, 0.9375}));
}

TEST(CheckPath, GivenUpItIsUnknownAndNoPlaceMoreIsTested) {
  const PointCell cell(TurningGrid(), [](int, int) { return false; });
  const CollisionChecker test(cell.table, cell.images, {});
  const std::vector<Configuration> path = {{0, 0}, {100 * kTurn, 0}};
  const int64_t all = test.CheckPath(path).checked;
  for (const int64_t most : {int64_t{0}, int64_t{1}, int64_t{100}, all - 1}) {
    int64_t asked = 0;
    int64_t tested = 0;
    const PathVerdict verdict = test.CheckPath(
        path, {},
        {.tested = [&](const TestedPlace&) { ++tested; }, .stop = [&] { return ++asked > most; }});
    EXPECT_TRUE(verdict.stopped);
    EXPECT_EQ(verdict.verdict.state(), State::kUnknown);
    EXPECT_EQ(verdict.checked, most);
    EXPECT_EQ(tested, most);
  }
  int64_t asked = 0;
  const PathVerdict whole = test.CheckPath(path, {}, {.stop = [&] { return ++asked > all; }});
  EXPECT_FALSE(whole.stopped);
  EXPECT_TRUE(whole.verdict.free());
}

TEST(SegmentPlaces, LineThatDoesNotMoveHasNone) {
  const Configuration q = {0.5, 1};
  SegmentPlaces places(UnitGrid(5, 5), q, q, SegmentPlaces::Border::kGridValues);
  EXPECT_EQ(places.Next(), std::nullopt);
}

}  // namespace
}  // namespace silhouette
