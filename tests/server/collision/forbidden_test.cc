// SPDX-License-Identifier: Apache-2.0
// Captured robot images: what is in a forbidden region is never free, on the grid or off it.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "server/collision/free_cells.h"
#include "tests/server/collision/index_of_table.h"
#include "tests/server/collision/random_cell.h"

namespace silhouette {
namespace {

constexpr MaskSize kForbiddenMask = {4, 4};
constexpr OffGrid kBothOffGrid[] = {OffGrid::kCell, OffGrid::kNearest};

ConfigurationGrid ForbiddenGrid() {
  return ConfigurationGrid({{.name = "a", .lower = 0, .upper = 90, .steps = 10},
                            {.name = "b", .lower = 0, .upper = 2, .steps = 3}});
}

// Every configuration was captured, and is free as far as images go.
RobotImageTable TableForbidding(JointRegions forbidden) {
  const ConfigurationGrid grid = ForbiddenGrid();
  RobotImageTable::Builder builder(grid, {kForbiddenMask}, 0, std::move(forbidden));
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (grid.Contains(number)) builder.Add(number, std::vector{Mask(kForbiddenMask)});
  }
  return std::move(builder).Build();
}

ObstacleImages NoObstacles() {
  return {ObstacleImage::FromScene(Mask(kForbiddenMask), Mask(kForbiddenMask))};
}

Configuration AnyPlace(std::mt19937_64& random) {
  return {std::uniform_real_distribution<double>(0, 90)(random),
          std::uniform_real_distribution<double>(0, 2)(random)};
}

JointRegions AnyRegion(std::mt19937_64& random) {
  const auto range = [&](size_t joint, double extent) {
    const double from = std::uniform_real_distribution<double>(0, extent)(random);
    return RegionRange{.joint = joint, .lower = from, .upper = from + extent / 15};
  };
  return random() % 2 == 0 ? JointRegions({{range(0, 90)}})
                           : JointRegions({{range(0, 90), range(1, 2)}});
}

TEST(Forbidden, RegionBetweenGridPointsIsNeverFreeNorIsAMotionAcrossIt) {
  const RobotImageTable table =
      TableForbidding(JointRegions({{{.joint = 0, .lower = 43, .upper = 46}}}));
  const ObstacleImages images = NoObstacles();
  for (const OffGrid off_grid : kBothOffGrid) {
    const CollisionChecker test(table, images, {.off_grid = off_grid});
    const auto path = [&](double from, double to) {
      return test.CheckPath(std::vector<Configuration>{{from, 0.5}, {to, 0.5}}).verdict;
    };
    for (const double a : {43.0, 44.9, 46.0}) {
      const Configuration q{a, 0.5};
      EXPECT_EQ(test.Check(q), Verdict::Unknown(Reason::kExcluded));
      EXPECT_EQ(test.TestRobotImages(q), std::nullopt);
    }
    EXPECT_TRUE(test.Check(Configuration{42.9, 0.5}).free());
    EXPECT_TRUE(test.Check(Configuration{40, 0.5}).free());
    EXPECT_EQ(path(40, 50), Verdict::Unknown(Reason::kExcluded));
    EXPECT_EQ(path(0, 90), Verdict::Unknown(Reason::kExcluded));
    EXPECT_TRUE(path(0, 42.9).free());
    EXPECT_TRUE(path(46.1, 90).free());
  }
}

TEST(Forbidden, PlaceWhoseNearestGridPointIsOutsideTheRegionIsNotFree) {
  const RobotImageTable table =
      TableForbidding(JointRegions({{{.joint = 0, .lower = 41, .upper = 55}}}));
  const ObstacleImages images = NoObstacles();
  const CollisionChecker test(table, images, {.off_grid = OffGrid::kNearest});
  EXPECT_TRUE(test.Check(Configuration{40, 0}).free());
  EXPECT_EQ(test.Check(Configuration{42, 0}), Verdict::Unknown(Reason::kExcluded));
  EXPECT_EQ(test.CheckPath(std::vector<Configuration>{{36, 0}, {44, 0}}).verdict,
            Verdict::Unknown(Reason::kExcluded));
}

TEST(Forbidden, CapturedGridPointsInARegionAreExcluded) {
  const RobotImageTable table =
      TableForbidding(JointRegions({{{.joint = 0, .lower = 40, .upper = 50}}}));
  const ConfigurationGrid& grid = table.grid();
  EXPECT_EQ(table.Count(RobotImageState::kExcluded), 6u);
  EXPECT_EQ(table.Count(RobotImageState::kPresent), 24u);
  EXPECT_EQ(table.Count(RobotImageState::kMissing), 0u);
  const ObstacleImages images = NoObstacles();
  const CollisionChecker test(table, images, {});
  for (const int a : {4, 5}) {
    const ConfigurationNumber number = grid.NumberOf({a, 2});
    EXPECT_EQ(test.Check(number), Verdict::Unknown(Reason::kExcluded));
    EXPECT_FALSE(table.present(number / kTileSize).Contains(number % kTileSize));
  }
  EXPECT_TRUE(test.Check(grid.NumberOf({3, 0})).free());
}

TEST(Forbidden, AllowedPlaceBesideARegionKeepsItsVerdict) {
  const RobotImageTable table =
      TableForbidding(JointRegions({{{.joint = 0, .lower = 40, .upper = 50}}}));
  const ObstacleImages images = NoObstacles();
  for (const OffGrid off_grid : kBothOffGrid) {
    const CollisionChecker test(table, images, {.off_grid = off_grid});
    for (const double a : {31.0, 38.0, 39.9, 50.1, 58.0}) {
      EXPECT_TRUE(test.Check(Configuration{a, 0.5}).free()) << a;
    }
    for (const double a : {40.0, 45.0, 50.0}) {
      EXPECT_EQ(test.Check(Configuration{a, 0.5}), Verdict::Unknown(Reason::kExcluded)) << a;
    }
  }
}

TEST(Forbidden, GridPointInARegionWithoutAnImageIsExcludedWhateverItsRecord) {
  const ConfigurationGrid grid = ForbiddenGrid();
  RobotImageTable::Builder builder(grid, {kForbiddenMask}, 0,
                                   JointRegions({{{.joint = 0, .lower = 40, .upper = 80}}}));
  builder.AddWithout(grid.NumberOf({4, 0}), RobotImageState::kExcluded);
  builder.AddWithout(grid.NumberOf({5, 0}), RobotImageState::kSuspect);
  builder.AddWithout(grid.NumberOf({6, 0}), RobotImageState::kEmpty);
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImages images = NoObstacles();
  const CollisionChecker test(table, images, {});
  for (const int a : {4, 5, 6, 7}) {
    EXPECT_EQ(test.Check(grid.NumberOf({a, 0})), Verdict::Unknown(Reason::kExcluded)) << a;
  }
  EXPECT_EQ(table.Count(RobotImageState::kExcluded), 15u);
  EXPECT_EQ(table.Count(RobotImageState::kMissing), 15u);
  EXPECT_EQ(test.Check(grid.NumberOf({3, 0})), Verdict::Unknown(Reason::kRobotImageMissing));
}

TEST(Forbidden, RegionThatDoesNotFitTheGridIsRefused) {
  EXPECT_THROW(TableForbidding(JointRegions({{{.joint = 2, .lower = 0, .upper = 1}}})),
               std::invalid_argument);
}

TEST(Forbidden, NeitherConfigurationNorCellNorNearestGridPointFreesAForbiddenPlace) {
  Random random;
  int forbidden = 0;
  int free = 0;
  int free_cells = 0;
  for (int round = 0; round < 100; ++round) {
    const RobotImageTable table = TableForbidding(AnyRegion(random));
    const ConfigurationGrid& grid = table.grid();
    const ObstacleImages images = NoObstacles();
    const IndexOfTable index(table);
    const CollisionChecker by_cell(table, images, {});
    const CollisionChecker nearest(table, images, {.off_grid = OffGrid::kNearest});
    const SpaceChecker space(by_cell, index.trees());
    EXPECT_EQ(space.CheckTile(0, index.tile(0)), by_cell.CheckTile(0));
    const PlaceSet free_points{by_cell.CheckTile(0).free};
    FreeCells cells(space, [&](uint64_t) { return round % 2 == 0 ? &index.tile(0) : nullptr; });
    const uint64_t tiles[] = {0};
    ASSERT_TRUE(cells.WorkOut(tiles, nullptr));
    for (int i = 0; i < 100; ++i) {
      const Configuration q = AnyPlace(random);
      const ConfigurationNumber low =
          grid.NumberOf({static_cast<int>(q[0] / 10), static_cast<int>(q[1])});
      const bool cell_is_free = cells.tile(0).Contains(low);
      free_cells += cell_is_free ? 1 : 0;
      if (table.forbidden().Between(q, q)) {
        ++forbidden;
        EXPECT_EQ(by_cell.Check(q), Verdict::Unknown(Reason::kExcluded));
        EXPECT_EQ(nearest.Check(q), Verdict::Unknown(Reason::kExcluded));
        EXPECT_FALSE(free_points.Contains(grid.Nearest(q).value()));
        EXPECT_FALSE(cell_is_free);
      } else if (cell_is_free) {
        EXPECT_TRUE(by_cell.Check(q).free());
      }
      free += by_cell.Check(q).free() ? 1 : 0;
    }
  }
  EXPECT_GT(forbidden, 50);
  EXPECT_GT(free, 1000);
  EXPECT_GT(free_cells, 1000);
}

TEST(Forbidden, NoFreePathTouchesARegion) {
  Random random;
  int free = 0;
  int across = 0;
  for (int round = 0; round < 200; ++round) {
    const RobotImageTable table = TableForbidding(AnyRegion(random));
    const ObstacleImages images = NoObstacles();
    const Configuration from = AnyPlace(random);
    const Configuration to = AnyPlace(random);
    bool touches = false;
    for (int i = 0; i <= 200; ++i) {
      const double way = i / 200.0;
      const Configuration q{std::lerp(from[0], to[0], way), std::lerp(from[1], to[1], way)};
      touches = touches || table.forbidden().Between(q, q);
    }
    across += touches ? 1 : 0;
    for (const OffGrid off_grid : kBothOffGrid) {
      const CollisionChecker test(table, images, {.off_grid = off_grid});
      const Verdict verdict = test.CheckPath(std::vector{from, to}).verdict;
      if (touches) {
        EXPECT_EQ(verdict, Verdict::Unknown(Reason::kExcluded));
      }
      free += verdict.free() ? 1 : 0;
    }
  }
  EXPECT_GT(free, 20);
  EXPECT_GT(across, 20);
}

}  // namespace
}  // namespace silhouette
