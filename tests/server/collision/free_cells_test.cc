// SPDX-License-Identifier: Apache-2.0
// Free cells of the grid: what the test of single places off the grid says of every place in them.
#include "server/collision/free_cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <numbers>
#include <numeric>
#include <random>
#include <thread>

#include "tests/random.h"
#include "tests/server/collision/index_of_table.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"
#include "tests/server/collision/random_grid.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

struct FreeCellsTest : ::testing::Test {
  Random random_;
};

// What the tests of one run met with, to show that they met with everything.
struct FreeCellsMet {
  uint64_t free = 0;
  uint64_t occupied = 0;
  uint64_t occupied_between_free = 0;
  uint64_t unknown = 0;
  uint64_t undecided = 0;
};

std::vector<uint64_t> AllTiles(const ConfigurationGrid& grid) {
  std::vector<uint64_t> tiles(grid.tiles());
  std::iota(tiles.begin(), tiles.end(), uint64_t{0});
  return tiles;
}

bool Never() { return false; }

// A place in the cell that begins at `low`; `inside`: on none of the grid's values, where the cell
// has more than one.
Configuration PlaceIn(const ConfigurationGrid& grid, const GridIndex& low, bool inside,
                      std::mt19937_64& random) {
  Configuration q = grid.At(low);
  for (size_t j = 0; j < q.size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    if (!joint.continuous && low[j] == joint.steps - 1) continue;
    const int part = inside ? 1 : static_cast<int>(random() % 3);
    const double fraction = std::uniform_real_distribution<double>(0.01, 0.99)(random);
    q[j] += joint.step() * (part == 1 ? fraction : part / 2.0);
  }
  return q;
}

// Some places of `count` cells, by their bits and by the test itself.
void ExpectTrue(const CollisionChecker& test, const FreeCells& cells, int count,
                std::mt19937_64& random, FreeCellsMet& met) {
  const ConfigurationGrid& grid = test.grid();
  for (int i = 0; i < count; ++i) {
    GridIndex low{};
    for (size_t j = 0; j < grid.joints().size(); ++j) {
      low[j] = static_cast<int>(random() % static_cast<unsigned>(grid.joints()[j].steps));
    }
    const ConfigurationNumber number = grid.NumberOf(low);
    const bool free = cells.tile(number / kTileSize).Contains(number % kTileSize);
    for (int place = 0; place < 4; ++place) {
      const Configuration q = PlaceIn(grid, low, place % 2 == 0, random);
      const Verdict verdict = test.Check(q);
      if (free) {
        ++met.free;
        ASSERT_EQ(verdict.state(), State::kFree) << "cell " << number << ", place " << place;
        continue;
      }
      const CellCorners corners = grid.CornersAround(q);
      if (place % 2 != 0 || corners.count() == 1) continue;
      bool known = true;
      bool between = true;
      for (const ConfigurationNumber corner : corners.numbers()) {
        known = known && test.Check(corner).state() != State::kUnknown;
        between = between && test.Check(corner).free();
      }
      if (!known) {
        ++met.unknown;
      } else if (!cells.exact()) {
        ++met.undecided;
      } else {
        ++met.occupied;
        if (between) ++met.occupied_between_free;
        ASSERT_EQ(verdict.state(), State::kOccupied) << "cell " << number << ", place " << place;
      }
    }
  }
}

TEST_F(FreeCellsTest, FreeOnesAreFreeThroughoutAndWherePlanesDecideTheOthersAreNot) {
  FreeCellsMet planes;
  FreeCellsMet lines;
  for (int round = 0; round < 120; ++round) {
    const ConfigurationGrid grid = RandomGrid(1 + round % 6, random_);
    const int views = 1 + static_cast<int>(random_() % 4);
    const std::vector<MaskSize> sizes = RandomSizes(views, random_);
    const RobotImageTable table = MovingTable(grid, sizes, random_);
    const IndexOfTable index(table);
    const EpipolarBands bands(RandomCalibration(views, 0.1, random_), sizes, 0.3);
    ObstacleImages images = RandomObstacleImages(sizes, 0.04, random_);
    if (round % 16 == 15) images[0].reset();
    const bool indexed = round % 3 != 0;
    const bool gaps = round % 5 == 0;
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      Policy policy{.preset = preset};
      if (round % 4 != 0) policy.min_views = 1 + static_cast<int>(random_()) % views;
      policy.min_views = std::clamp(policy.min_views.value_or(views), 1, views);
      const CollisionChecker test(table, images, policy, {.bands = &bands});
      const SpaceChecker space(test, index.trees());
      FreeCells cells(space, [&](uint64_t tile) {
        const bool there = indexed && !(gaps && tile % 2 == 1);
        return there ? &index.tile(tile) : nullptr;
      });
      ASSERT_TRUE(cells.WorkOut(AllTiles(grid), Never));
      EXPECT_EQ(cells.exact(), images[0].has_value() && preset != Preset::kCalibrated);
      ASSERT_NO_FATAL_FAILURE(
          ExpectTrue(test, cells, 150, random_, preset == Preset::kCalibrated ? lines : planes))
          << NameOf(preset) << ", round " << round << ", " << grid.tiles() << " tiles, "
          << *policy.min_views << " of " << views << " views";
    }
  }
  EXPECT_GT(planes.free, 1000u);
  EXPECT_GT(planes.occupied, 1000u);
  EXPECT_GT(planes.occupied_between_free, 100u);
  EXPECT_GT(planes.unknown, 10u);
  EXPECT_GT(lines.free, 1000u);
  EXPECT_GT(lines.undecided, 10u);
}

TEST_F(FreeCellsTest, UnderSoundPresetsFreeOnesAreFreeThroughout) {
  using testing::SphereWorld;
  const SphereWorld world = testing::ParallelWorld();
  const IndexOfTable index(world.table);
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  FreeCellsMet met;
  for (int round = 0; round < 8; ++round) {
    const ConfigurationNumber present = all[random_() % all.size()];
    const ObstacleImages images =
        world.See(testing::SomeObstacles(1 + round % 3, random_), present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      TestSupport support{.possible_space = &possible};
      if (round % 2 == 0) {
        support.robot_may_touch = [](std::span<const double>, std::span<const double>,
                                     const Eigen::AlignedBox3d&) { return false; };
      }
      const CollisionChecker test(world.table, images, {.preset = preset}, support);
      const SpaceChecker space(test, index.trees());
      FreeCells cells(space, [&](uint64_t tile) { return &index.tile(tile); });
      ASSERT_TRUE(cells.WorkOut(AllTiles(test.grid()), Never));
      ASSERT_NO_FATAL_FAILURE(ExpectTrue(test, cells, 400, random_, met)) << NameOf(preset);
    }
  }
  std::cout << "sound: " << met.free << " free, " << met.occupied << " occupied, " << met.undecided
            << " undecided\n";
  EXPECT_GT(met.free, 0u);
  EXPECT_GT(met.occupied + met.undecided, 0u);
}

// An empty robot image counts as touching where a part reaches beyond the image.
TEST_F(FreeCellsTest, CornerOutsideTheImagesIsNoProof) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 3}});
  const std::vector<PixelTree> trees = {PixelTree({8, 8})};
  RobotImageTable::Builder builder(grid, {{8, 8}});
  Mask pixel = Mask::FromPredicate({8, 8}, [](int x, int y) { return x == 4 && y == 4; });
  for (const ConfigurationNumber number : {0, 1, 2}) {
    builder.Add(number, std::vector{number == 0 ? Mask({8, 8}) : pixel});
  }
  const RobotImageTable table = std::move(builder).Build();
  const IndexOfTable index(table);
  const Mask rim = Mask::FromPredicate({8, 8}, [](int x, int) { return x == 0; });
  const PlaneVotes votes(trees, {rim}, 1, {true});
  EXPECT_TRUE(votes.beyond());
  EXPECT_TRUE(votes.TouchingIn(0, index.tile(0)).Contains(0));
  EXPECT_FALSE(votes.TouchingIn(0, index.tile(0)).Contains(1));
  for (const ConfigurationNumber number : {0, 1, 2}) {
    EXPECT_EQ(votes.TouchesIn(0, table.image(0, number)),
              votes.TouchingIn(0, index.tile(0)).Contains(number));
  }
}

TEST_F(FreeCellsTest, ImageThatCannotBeReadLeavesItsCellsUnknownAndNothingExact) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 100}});
  const std::vector<MaskSize> sizes = {{8, 8}};
  RobotImageTable::Builder builder(grid, sizes, [](ConfigurationNumber number, auto words) {
    std::ranges::fill(words, 0);
    return number != 40;
  });
  for (ConfigurationNumber number = 0; number < 100; ++number) {
    builder.Add(number, std::vector{Mask({8, 8})});
  }
  const RobotImageTable table = std::move(builder).Build();
  const std::vector<PixelTree> trees = {PixelTree({8, 8})};
  const ObstacleImages images = RandomObstacleImages(sizes, 0.1, random_);
  const CollisionChecker test(table, images, {});
  const SpaceChecker space(test, trees);
  FreeCells cells(space, [](uint64_t) { return nullptr; });
  ASSERT_TRUE(cells.WorkOut(AllTiles(grid), Never));
  EXPECT_FALSE(cells.exact());
  for (uint64_t place = 0; place < kTileSize; ++place) {
    EXPECT_EQ(cells.tile(0).Contains(place), place < 100 && place != 40 && place != 39) << place;
  }
}

TEST_F(FreeCellsTest, StoppedWorkGoesOnWhereItWasAndThreadsShareIt) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 90},
                                {.name = "b", .lower = 0, .upper = 1, .steps = 90}},
                               {16, 256});
  const std::vector<MaskSize> sizes = {{8, 8}, {9, 7}};
  const RobotImageTable table = MovingTable(grid, sizes, random_);
  const IndexOfTable index(table);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.1, random_);
  const CollisionChecker test(table, images, {});
  const SpaceChecker space(test, index.trees());
  std::atomic<int> looked_up = 0;
  const auto index_of = [&](uint64_t tile) {
    ++looked_up;
    return &index.tile(tile);
  };
  FreeCells whole(space, index_of);
  ASSERT_TRUE(whole.WorkOut(AllTiles(grid), Never));
  // Once in passing, and once at what it has.
  EXPECT_EQ(looked_up, static_cast<int>(2 * grid.tiles()));
  looked_up = 0;
  FreeCells parts(space, index_of);
  int calls = 0;
  while (!parts.WorkOut(AllTiles(grid), [&, steps = 0]() mutable { return ++steps > 2; })) ++calls;
  EXPECT_GT(calls, 3);
  EXPECT_EQ(looked_up, static_cast<int>(2 * grid.tiles()));
  FreeCells shared(space, index_of);
  {
    std::vector<std::jthread> threads;
    for (const uint64_t first : {4u, 0u, 2u}) {
      threads.emplace_back([&, first] {
        const uint64_t own[] = {first, first + 1};
        EXPECT_TRUE(shared.WorkOut(own, Never));
      });
    }
  }
  for (uint64_t tile = 0; tile < grid.tiles(); ++tile) {
    ASSERT_TRUE(shared.ready(tile));
    EXPECT_EQ(parts.tile(tile), whole.tile(tile));
    EXPECT_EQ(shared.tile(tile), whole.tile(tile));
  }
}

}  // namespace
}  // namespace silhouette
