// SPDX-License-Identifier: Apache-2.0
// Robot images that are read when they are needed: the same answers as with images in memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "server/collision/clearance.h"
#include "server/collision/collision_checker.h"
#include "server/collision/space_checker.h"
#include "tests/server/collision/index_of_table.h"
#include "tests/server/collision/random_geometry.h"
#include "tests/server/collision/sphere_world.h"
#include "tests/server/collision/table_in_place.h"

namespace silhouette {
namespace {

struct SameInPlace : TableInPlace {
  // What was met with.
  uint64_t free = 0;
  uint64_t occupied = 0;
  uint64_t unknown = 0;

  void Count(const Verdict& verdict) {
    free += verdict.state() == State::kFree;
    occupied += verdict.state() == State::kOccupied;
    unknown += verdict.state() == State::kUnknown;
  }

  void ExpectSameChecks(const CollisionChecker& held, const CollisionChecker& read,
                        const ConfigurationGrid& grid, int views) {
    std::vector<ViewEvidence> held_evidence(static_cast<size_t>(views));
    std::vector<ViewEvidence> read_evidence(static_cast<size_t>(views));
    for (int i = 0; i < 40; ++i) {
      const Configuration q = AnyConfiguration(grid);
      const Verdict verdict = held.Check(q, held_evidence);
      Count(verdict);
      ASSERT_EQ(verdict, read.Check(q, read_evidence));
      ASSERT_EQ(held_evidence, read_evidence);
      ASSERT_EQ(held.TestRobotImages(q), read.TestRobotImages(q));
      const ConfigurationNumber number = random() % grid.number_limit();
      ASSERT_EQ(held.Check(number), read.Check(number));
    }
    for (int i = 0; i < 10; ++i) {
      const std::vector<Configuration> path = {AnyConfiguration(grid), AnyConfiguration(grid)};
      const PathVerdict verdict = held.CheckPath(path, held_evidence);
      const PathVerdict same = read.CheckPath(path, read_evidence);
      ASSERT_EQ(verdict.verdict, same.verdict);
      ASSERT_EQ(verdict.checked, same.checked);
      ASSERT_EQ(verdict.segment, same.segment);
      ASSERT_EQ(verdict.fraction, same.fraction);
      ASSERT_EQ(held_evidence, read_evidence);
    }
  }

  void ExpectSameTiles(const CollisionChecker& held, const CollisionChecker& read,
                       const IndexOfTable& index, const ConfigurationGrid& grid) {
    const SpaceChecker by_index(read, index.trees());
    for (uint64_t tile = 0; tile < grid.tiles(); ++tile) {
      const TileVerdicts verdicts = held.CheckTile(tile);
      ASSERT_EQ(verdicts, read.CheckTile(tile));
      ASSERT_EQ(verdicts, by_index.CheckTile(tile, index.tile(tile)));
    }
  }
};

TEST_F(SameInPlace, IsTheSameTable) {
  const std::vector<MaskSize> sizes = RandomSizes(3, random);
  const RobotImageTable held = TableWithGaps(Grid(), sizes, random);
  const RobotImageTable read = ReadFrom(held);
  EXPECT_TRUE(held.in_memory());
  EXPECT_FALSE(read.in_memory());
  for (ConfigurationNumber number = 0; number < held.grid().number_limit(); ++number) {
    ASSERT_EQ(held.state(number), read.state(number));
    if (held.state(number) != RobotImageState::kPresent) continue;
    ASSERT_EQ(held.Images(number), read.Images(number));
    for (int view = 0; view < 3; ++view) {
      ASSERT_TRUE(
          std::ranges::equal(held.image(view, number), (*read.Images(number))[view].words()));
    }
  }
  for (int view = 0; view < 3; ++view) {
    EXPECT_EQ(held.permanent(view), read.permanent(view));
    EXPECT_EQ(held.covered(view), read.covered(view));
  }
  for (uint64_t tile = 0; tile < held.grid().tiles(); ++tile) {
    EXPECT_EQ(held.present(tile), read.present(tile));
  }
  EXPECT_THROW(RobotImageTable::Builder(Grid(), sizes, nullptr), std::invalid_argument);
}

TEST_F(SameInPlace, GivesTheSameAnswersUnderEveryPresetOfPlanesAndLines) {
  for (int round = 0; round < 20; ++round) {
    const int views = 1 + round % 4;
    const std::vector<MaskSize> sizes = RandomSizes(views, random);
    const RobotImageTable held_table = TableWithGaps(Grid(), sizes, random);
    const RobotImageTable read_table = ReadFrom(held_table);
    const IndexOfTable index(held_table);
    const EpipolarBands bands(RandomCalibration(views, 0.1, random), sizes, 0.3);
    const ObstacleImages images = RandomBoxScene(sizes, round % 3 == 0, random);
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      for (const OffGrid off_grid : {OffGrid::kCell, OffGrid::kNearest}) {
        const Policy policy{.preset = preset, .min_views = 1 + round % views, .off_grid = off_grid};
        const TestSupport support{.bands = &bands};
        const CollisionChecker held(held_table, images, policy, support);
        const CollisionChecker read(read_table, images, policy, support);
        ASSERT_NO_FATAL_FAILURE(ExpectSameChecks(held, read, Grid(), views)) << NameOf(preset);
        ASSERT_NO_FATAL_FAILURE(ExpectSameTiles(held, read, index, Grid())) << NameOf(preset);
      }
    }
  }
  EXPECT_GT(free, 0u);
  EXPECT_GT(occupied, 0u);
  EXPECT_GT(unknown, 0u);
}

TEST_F(SameInPlace, GivesTheSameAnswersUnderTheSoundPresets) {
  using testing::SphereWorld;
  const SphereWorld world = testing::ParallelWorld();
  const RobotImageTable read_table = ReadFrom(world.table);
  const IndexOfTable index(world.table);
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  for (int round = 0; round < 4; ++round) {
    const ConfigurationNumber present = all[random() % all.size()];
    const ObstacleImages images = world.See(testing::SomeObstacles(1, random), present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      const TestSupport support{.possible_space = &possible};
      const CollisionChecker held(world.table, images, {.preset = preset}, support);
      const CollisionChecker read(read_table, images, {.preset = preset}, support);
      ASSERT_NO_FATAL_FAILURE(ExpectSameChecks(held, read, SphereWorld::Grid(), 3));
      ASSERT_NO_FATAL_FAILURE(ExpectSameTiles(held, read, index, SphereWorld::Grid()));
    }
  }
  EXPECT_GT(free, 0u);
  EXPECT_GT(occupied, 0u);
}

TEST_F(SameInPlace, MeasuresTheSameClearance) {
  const std::vector<MaskSize> sizes = RandomSizes(3, random);
  const RobotImageTable held_table = RandomTable(Grid(), sizes, 0.02, random);
  const RobotImageTable read_table = ReadFrom(held_table);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.02, random);
  const DistanceImages distances = DistancesTo(ObstaclePlanes(images));
  const CollisionChecker held(held_table, images, {});
  const CollisionChecker read(read_table, images, {});
  const ClearanceMeter held_meter(held, images, {}, {}, distances);
  const ClearanceMeter read_meter(read, images, {}, {}, distances);
  int measured = 0;
  for (int i = 0; i < 200; ++i) {
    const Configuration q = AnyConfiguration(Grid());
    const auto clearance = held_meter.Measure(q, held.Check(q));
    measured += clearance.value_or(0) > 0;
    ASSERT_EQ(clearance, read_meter.Measure(q, read.Check(q)));
  }
  EXPECT_GT(measured, 0);
}

}  // namespace
}  // namespace silhouette
