// SPDX-License-Identifier: Apache-2.0
// Whole tiles by the collision index: the same verdicts as one configuration at a time.
#include "server/collision/space_checker.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "tests/random.h"
#include "tests/server/collision/index_of_table.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

struct SpaceTestTest : ::testing::Test {
  Random random_;
};

// What the tests of one run met with, to show that they met with everything.
struct SpaceTestMet {
  uint64_t free = 0;
  uint64_t occupied = 0;
  uint64_t open = 0;
  uint64_t closed = 0;
};

uint64_t Count(const PlaceSet& set) {
  uint64_t count = 0;
  for (const uint64_t word : set.words) count += static_cast<uint64_t>(std::popcount(word));
  return count;
}

void SpaceTestExpectSame(const CollisionChecker& test, const RobotImageTable& table,
                         const IndexOfTable& index, SpaceTestMet& met) {
  const SpaceChecker space(test, index.trees());
  for (uint64_t tile = 0; tile < table.grid().tiles(); ++tile) {
    const TileVerdicts verdicts = space.CheckTile(tile, index.tile(tile));
    ASSERT_EQ(verdicts, test.CheckTile(tile)) << "tile " << tile;
    const uint64_t open = Count(space.Open(index.tile(tile)));
    met.open += open;
    met.closed += Count(table.present(tile)) - open;
    met.free += Count({verdicts.free});
    met.occupied += Count({verdicts.occupied});
  }
}

TEST_F(SpaceTestTest, EveryPresetOfPlanesAndLinesIsTheSameAsOneByOne) {
  SpaceTestMet met;
  for (int round = 0; round < 40; ++round) {
    const int views = 1 + round % 5;
    const std::vector<MaskSize> sizes = RandomSizes(views, random_);
    const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 70},
                                  {.name = "b", .lower = 0, .upper = 1, .steps = 20}});
    const RobotImageTable table = TableWithGaps(grid, sizes, random_);
    const IndexOfTable index(table);
    const EpipolarBands bands(RandomCalibration(views, 0.1, random_), sizes, 0.3);
    const ObstacleImages images = RandomBoxScene(sizes, round % 2 == 0, random_);
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      for (int min_views = 1; min_views <= views; ++min_views) {
        const CollisionChecker test(table, images, {.preset = preset, .min_views = min_views},
                                    {.bands = &bands});
        ASSERT_NO_FATAL_FAILURE(SpaceTestExpectSame(test, table, index, met))
            << NameOf(preset) << ", " << min_views << " of " << views << " views";
      }
    }
  }
  EXPECT_GT(met.free, 0u);
  EXPECT_GT(met.occupied, 0u);
  EXPECT_GT(met.open, 0u);
  EXPECT_GT(met.closed, met.open);
}

TEST_F(SpaceTestTest, SoundPresetsAreTheSameAsOneByOne) {
  using testing::SphereWorld;
  const SphereWorld world = testing::ParallelWorld();
  const IndexOfTable index(world.table);
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  SpaceTestMet met;
  for (int round = 0; round < 6; ++round) {
    const ConfigurationNumber present = all[random_() % all.size()];
    ObstacleImages images = world.See(testing::SomeObstacles(1 + round % 3, random_), present);
    if (round == 5) images[1].reset();
    const PossibleSpace possible(world.space, images, world.Body(present));
    for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      for (const bool body : {false, true}) {
        TestSupport support{.possible_space = &possible};
        if (body) {
          support.robot_may_touch = [](std::span<const double> from, std::span<const double>,
                                       const Eigen::AlignedBox3d&) {
            return std::lround(1000 * (from[0] + from[1])) % 2 == 0;
          };
        }
        const CollisionChecker test(world.table, images, {.preset = preset}, support);
        ASSERT_NO_FATAL_FAILURE(SpaceTestExpectSame(test, world.table, index, met))
            << NameOf(preset);
      }
    }
  }
  EXPECT_GT(met.occupied, 0u);
  EXPECT_GT(met.open, 0u);
}

TEST_F(SpaceTestTest, ConfigurationThatOnlyTheIndexHasIsUnknown) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 100}});
  const std::vector<MaskSize> sizes = {{8, 8}};
  const IndexOfTable index(RandomTable(grid, sizes, 0.1, random_));
  RobotImageTable::Builder builder(grid, sizes);
  for (ConfigurationNumber number = 0; number < 100; ++number) {
    if (number == 40) {
      builder.AddWithout(number, RobotImageState::kCorrupt);
    } else if (number != 50) {
      builder.Add(number, std::vector{RandomMask(sizes[0], 0.1, random_)});
    }
  }
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImages images = RandomObstacleImages(sizes, 0.01, random_);
  const CollisionChecker test(table, images, {});
  const TileVerdicts verdicts = SpaceChecker(test, index.trees()).CheckTile(0, index.tile(0));
  for (const uint64_t place : {40u, 50u, 100u}) {
    EXPECT_FALSE(PlaceSet{verdicts.free}.Contains(place)) << place;
    EXPECT_FALSE(PlaceSet{verdicts.occupied}.Contains(place)) << place;
  }
  EXPECT_EQ(Count({verdicts.free}) + Count({verdicts.occupied}), 98u);
}

}  // namespace
}  // namespace silhouette
