// SPDX-License-Identifier: Apache-2.0
// Clearance levels of whole tiles: the same as clearances measured one by one.
#include "server/collision/level_checker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>

#include "server/collision/space_checker.h"
#include "tests/random.h"
#include "tests/server/collision/index_of_table.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

struct LevelTestTest : ::testing::Test {
  Random random_;
};

// What the tests of one run met with, to show that they met with everything.
struct LevelTestMet {
  uint64_t above = 0;
  uint64_t not_above = 0;
  uint64_t at_a_level = 0;
  uint64_t infinite = 0;
};

// The clearances of the free configurations of a tile; nothing for the others.
std::vector<std::optional<double>> ClearancesOf(const CollisionChecker& test,
                                                const ClearanceMeter& meter, uint64_t tile,
                                                const PlaceSet& free) {
  std::vector<std::optional<double>> clearances(kTileSize);
  for (uint64_t place = 0; place < kTileSize; ++place) {
    if (!free.Contains(place)) continue;
    const Configuration q = test.grid().At(tile * kTileSize + place);
    clearances[place] = meter.Measure(q, test.Check(q));
  }
  return clearances;
}

// Levels of which some are clearances that occur, and their neighbours.
std::vector<double> LevelsAmong(const std::vector<std::optional<double>>& clearances,
                                std::mt19937_64& random) {
  std::vector<double> levels = {0, 0.7, 1, 3, 1e300};
  for (int i = 0; i < 20; ++i) {
    const std::optional<double>& clearance = clearances[random() % clearances.size()];
    if (!clearance || !std::isfinite(*clearance)) continue;
    levels.push_back(*clearance);
    levels.push_back(std::nextafter(*clearance, 1e9));
    if (*clearance > 0) levels.push_back(std::nextafter(*clearance, 0.0));
  }
  std::ranges::sort(levels);
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  return levels;
}

void LevelTestExpectSame(const CollisionChecker& test, const ClearanceMeter& meter,
                         const IndexOfTable& index, std::mt19937_64& random, LevelTestMet& met) {
  for (uint64_t tile = 0; tile < test.grid().tiles(); ++tile) {
    const PlaceSet free{test.CheckTile(tile).free};
    const auto clearances = ClearancesOf(test, meter, tile, free);
    const std::vector<double> levels = LevelsAmong(clearances, random);
    const LevelChecker by_index(meter, levels, index.trees());
    const auto above = by_index.Above(tile, &index.tile(tile), free);
    ASSERT_EQ(above.size(), levels.size());
    ASSERT_EQ(LevelChecker(meter, levels).Above(tile, nullptr, free), above) << "tile " << tile;
    ASSERT_EQ(by_index.Above(tile, nullptr, free), above) << "tile " << tile;
    for (size_t i = 0; i < levels.size(); ++i) {
      PlaceSet expected;
      for (uint64_t place = 0; place < kTileSize; ++place) {
        if (!clearances[place]) continue;
        const bool is_above = *clearances[place] > levels[i];
        if (is_above) expected.Insert(place);
        ++(is_above ? met.above : met.not_above);
        if (*clearances[place] == levels[i]) ++met.at_a_level;
        if (std::isinf(*clearances[place])) ++met.infinite;
      }
      ASSERT_EQ(above[i], expected) << "tile " << tile << ", level " << levels[i];
    }
  }
}

void ExpectEverythingMet(const LevelTestMet& met) {
  EXPECT_GT(met.above, 0u);
  EXPECT_GT(met.not_above, 0u);
  EXPECT_GT(met.at_a_level, 0u);
  EXPECT_GT(met.infinite, 0u);
}

// Few pixels each, so that there is room between them; some configurations have no robot image.
RobotImageTable LevelTestSparseTable(const ConfigurationGrid& grid,
                                     const std::vector<MaskSize>& sizes, std::mt19937_64& random) {
  RobotImageTable::Builder builder(grid, sizes, grid.size());
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number) || random() % 50 == 0) continue;
    if (random() % 50 == 0) {
      builder.AddWithout(number, RobotImageState::kCorrupt);
      continue;
    }
    std::vector<Mask> masks;
    for (const MaskSize size : sizes) masks.push_back(RandomMask(size, 0.02, random));
    builder.Add(number, masks);
  }
  return std::move(builder).Build();
}

ObstacleImages LevelTestRandomScene(const std::vector<MaskSize>& sizes, bool may_lack_a_view,
                                    std::mt19937_64& random) {
  const double foreground = random() % 2 == 0 ? 0.01 : 0.05;
  const double robot = random() % 2 == 0 ? 0.05 : 0.2;
  ObstacleImages images;
  for (const MaskSize size : sizes) {
    images.push_back(ObstacleImage::FromScene(RandomMask(size, foreground, random),
                                              RandomMask(size, robot, random)));
  }
  if (may_lack_a_view) images[random() % images.size()].reset();
  return images;
}

TEST_F(LevelTestTest, EveryPresetOfPlanesAndLinesIsTheSameAsMeasuredOneByOne) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 70},
                                {.name = "b", .lower = 0, .upper = 1, .steps = 5}});
  LevelTestMet met;
  LevelTestMet of_lines;
  for (int round = 0; round < 24; ++round) {
    const int views = 1 + round % 4;
    std::vector<MaskSize> sizes;
    for (int view = 0; view < views; ++view) {
      sizes.push_back({6 + static_cast<int>(random_() % 14), 6 + static_cast<int>(random_() % 14)});
    }
    const RobotImageTable table = LevelTestSparseTable(grid, sizes, random_);
    const IndexOfTable index(table);
    const EpipolarBands bands(RandomCalibration(views, 0.1, random_), sizes, 0.3);
    const ObstacleImages images = LevelTestRandomScene(sizes, round % 6 == 5, random_);
    const DistanceImages to_obstacles = DistancesTo(ObstaclePlanes(images));
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      const Policy policy{.preset = preset, .min_views = 1 + static_cast<int>(random_() % views)};
      const TestSupport support{.bands = &bands};
      const CollisionChecker test(table, images, policy, support);
      const bool lines = preset == Preset::kCalibrated;
      const DistanceImages distances = preset == Preset::kPaperCalibrated
                                           ? DistancesTo(ResolvedObstacleImages(images, bands))
                                           : to_obstacles;
      const ClearanceMeter meter(test, images, policy, support, distances);
      ASSERT_NO_FATAL_FAILURE(
          LevelTestExpectSame(test, meter, index, random_, lines ? of_lines : met))
          << NameOf(preset) << ", " << *policy.min_views << " of " << views << " views";
    }
  }
  ExpectEverythingMet(met);
  ExpectEverythingMet(of_lines);
}

TEST_F(LevelTestTest, SoundPresetsAreTheSameAsMeasuredOneByOne) {
  using testing::BallCamera;
  using testing::Balls;
  using testing::LookingAt;
  using testing::SphereWorld;
  const SphereWorld world({BallCamera(LookingAt({2.4, 0.4, 1.1}, {0, 0, 0}, {44, 44}, 0.75)),
                           BallCamera(LookingAt({-1.0, 2.3, 0.6}, {0.5, 0.3, 0}, {40, 40}, 0.15)),
                           BallCamera(LookingAt({-0.3, -0.2, 2.6}, {0, 0, 0}, {44, 44}, 0.75))},
                          0.12, 0.03);
  const IndexOfTable index(world.table);
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  std::uniform_real_distribution<double> place(-0.8, 0.8);
  LevelTestMet met;
  for (int round = 0; round < 5; ++round) {
    const ConfigurationNumber present = all[random_() % all.size()];
    const Balls obstacles{{{place(random_), place(random_), 0.5 * place(random_)}, 0.15}};
    const ObstacleImages images = world.See(obstacles, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    const DistanceImages distances = DistancesTo(ObstaclePlanes(images));
    const TestSupport support{.possible_space = &possible};
    for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      const Policy policy{.preset = preset, .min_views = 2 + round % 2};
      const CollisionChecker test(world.table, images, policy, support);
      const ClearanceMeter meter(test, images, policy, support, distances);
      ASSERT_NO_FATAL_FAILURE(LevelTestExpectSame(test, meter, index, random_, met))
          << NameOf(preset);
    }
  }
  EXPECT_GT(met.above, 0u);
  EXPECT_GT(met.not_above, 0u);
}

// One row of pixels; configuration i has the robot in pixel i, the obstacle is pixel 10.
struct LevelTestRow {
  LevelTestRow() {
    RobotImageTable::Builder builder(
        ConfigurationGrid({{.name = "a", .lower = 0, .upper = 1, .steps = 10}}), {{20, 1}});
    for (int i = 0; i < 10; ++i) {
      builder.Add(static_cast<ConfigurationNumber>(i),
                  std::vector{Mask::FromPredicate({20, 1}, [=](int x, int) { return x == i; })});
    }
    table.emplace(std::move(builder).Build());
    images.push_back(ObstacleImage::FromObstacles(
        Mask::FromPredicate({20, 1}, [](int x, int) { return x == 10; }), Mask({20, 1})));
    distances = DistancesTo(ObstaclePlanes(images));
    test.emplace(*table, images, Policy{});
    meter.emplace(*test, images, Policy{}, TestSupport{}, distances);
  }

  std::optional<RobotImageTable> table;
  ObstacleImages images;
  DistanceImages distances;
  std::optional<CollisionChecker> test;
  std::optional<ClearanceMeter> meter;
};

TEST(ClearanceLevels, ClearanceThatIsTheLevelIsNotAbove) {
  const LevelTestRow row;
  const IndexOfTable index(*row.table);
  const std::vector<double> levels = {0, 2, 8.5, 9};
  const auto above = LevelChecker(*row.meter, levels, index.trees())
                         .Above(0, &index.tile(0), PlaceSet{row.test->CheckTile(0).free});
  EXPECT_EQ(above[0].words[0], 0b0111111111u) << "the last one touches the obstacle";
  EXPECT_EQ(above[1].words[0], 0b0001111111u);
  EXPECT_EQ(above[2].words[0], 0b0000000001u);
  EXPECT_TRUE(above[3].Empty());
}

TEST(ClearanceLevels, OnlyConfigurationsThatAreFreeAreAbove) {
  const LevelTestRow row;
  const IndexOfTable index(*row.table);
  const std::vector<double> levels = {1};
  PlaceSet free;
  free.Insert(3);
  for (const TileIndex* of_tile : {&index.tile(0), static_cast<const TileIndex*>(nullptr)}) {
    EXPECT_EQ(LevelChecker(*row.meter, levels, index.trees()).Above(0, of_tile, free)[0], free);
    EXPECT_TRUE(LevelChecker(*row.meter, levels, index.trees()).Above(0, of_tile, {})[0].Empty());
  }
}

TEST(ClearanceLevels, ThatCannotBeAreRefused) {
  const LevelTestRow row;
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<std::vector<double>> refused = {{},     {-1},       {1, 1},
                                                    {2, 1}, {infinity}, {std::nan("")}};
  for (const std::vector<double>& levels : refused) {
    EXPECT_THROW(LevelChecker(*row.meter, levels), std::invalid_argument);
  }
}

}  // namespace
}  // namespace silhouette
