// Robot images that are read when they are needed: the same answers as with images in memory, and
// none that is free where one cannot be read.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "server/collision/clearance.h"
#include "server/collision/collision_test.h"
#include "server/collision/space_test.h"
#include "tests/server/collision/index_of_table.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

// A table that reads what another one holds, but for the configurations in `lost`.
RobotImageTable ReadFrom(const RobotImageTable& held, const std::set<uint64_t>& lost = {}) {
  const std::vector<MaskSize> sizes(held.mask_sizes().begin(), held.mask_sizes().end());
  RobotImageTable::Builder builder(
      held.grid(), sizes, [&held, lost](ConfigurationNumber number, std::span<uint64_t> words) {
        return !lost.contains(number) && held.Read(number, words);
      });
  std::vector<uint64_t> words(held.words());
  for (ConfigurationNumber number = 0; number < held.grid().number_limit(); ++number) {
    const RobotImageState state = held.state(number);
    if (state == RobotImageState::kExcluded) builder.AddExcluded(number);
    if (state == RobotImageState::kCorrupt) builder.AddCorrupt(number);
    if (state != RobotImageState::kPresent) continue;
    held.Read(number, words);
    builder.Add(number, words);
  }
  return std::move(builder).Build();
}

struct TableInPlace : ::testing::Test {
  const unsigned seed = std::random_device{}();
  std::mt19937 random{seed};
  ::testing::ScopedTrace trace{__FILE__, __LINE__, "seed " + std::to_string(seed)};
  // What was met with.
  uint64_t free = 0;
  uint64_t occupied = 0;
  uint64_t unknown = 0;

  ConfigurationGrid Grid() {
    return ConfigurationGrid({{.name = "a", .lower = 0, .upper = 1, .steps = 20},
                              {.name = "b", .lower = 0, .upper = 6, .steps = 12},
                              {.name = "c", .lower = 0, .upper = 3, .steps = 5}});
  }

  // Anywhere, also outside; on the grid as often as between its values.
  Configuration AnyConfiguration(const ConfigurationGrid& grid) {
    Configuration q;
    for (const GridJoint& joint : grid.joints()) {
      const double place = std::uniform_real_distribution(-0.2, joint.steps - 0.9)(random);
      q.push_back(joint.lower + joint.step() * (random() % 2 == 0 ? place : std::floor(place)));
    }
    return q;
  }

  void Count(const Verdict& verdict) {
    free += verdict.state() == State::kFree;
    occupied += verdict.state() == State::kOccupied;
    unknown += verdict.state() == State::kUnknown;
  }

  void ExpectSameChecks(const CollisionTest& held, const CollisionTest& read,
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

  void ExpectSameTiles(const CollisionTest& held, const CollisionTest& read,
                       const IndexOfTable& index, const ConfigurationGrid& grid) {
    const SpaceTest by_index(read, index.trees());
    for (uint64_t tile = 0; tile < grid.tiles(); ++tile) {
      const TileVerdicts verdicts = held.CheckTile(tile);
      ASSERT_EQ(verdicts, read.CheckTile(tile));
      ASSERT_EQ(verdicts, by_index.CheckTile(tile, index.tile(tile)));
    }
  }
};

TEST_F(TableInPlace, IsTheSameTable) {
  const std::vector<MaskSize> sizes = RandomSizes(3, random);
  const RobotImageTable held = TableWithGaps(Grid(), sizes, random);
  const RobotImageTable read = ReadFrom(held);
  EXPECT_TRUE(held.in_memory());
  EXPECT_FALSE(read.in_memory());
  for (ConfigurationNumber number = 0; number < held.grid().number_limit(); ++number) {
    ASSERT_EQ(held.state(number), read.state(number));
    if (held.state(number) != RobotImageState::kPresent) continue;
    std::vector<Mask> masks;
    for (int view = 0; view < 3; ++view) masks.push_back(held.ImageAsMask(view, number));
    ASSERT_EQ(held.Images(number), masks);
    ASSERT_EQ(read.Images(number), masks);
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

TEST_F(TableInPlace, GivesTheSameAnswersUnderEveryPresetOfPlanesAndLines) {
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
        Policy policy{.preset = preset, .min_views = 1 + round % views, .off_grid = off_grid};
        if (IsCalibrated(preset) && random() % 2 == 0) {
          policy.epipolar = EpipolarDomain::kIntersection;
        }
        const TestSupport support{.bands = &bands};
        const CollisionTest held(held_table, images, policy, support);
        const CollisionTest read(read_table, images, policy, support);
        ASSERT_NO_FATAL_FAILURE(ExpectSameChecks(held, read, Grid(), views)) << NameOf(preset);
        ASSERT_NO_FATAL_FAILURE(ExpectSameTiles(held, read, index, Grid())) << NameOf(preset);
      }
    }
  }
  EXPECT_GT(free, 0u);
  EXPECT_GT(occupied, 0u);
  EXPECT_GT(unknown, 0u);
}

TEST_F(TableInPlace, GivesTheSameAnswersUnderTheSoundPresets) {
  using testing::BallCamera;
  using testing::SphereWorld;
  using testing::Vector3d;
  const SphereWorld world({BallCamera(Vector3d(0, 0, -1), 40), BallCamera(Vector3d(1, 0, 0), 40),
                           BallCamera(Vector3d(-1, 1, -1), 40)},
                          0.06, 0.02);
  const RobotImageTable read_table = ReadFrom(world.table);
  const IndexOfTable index(world.table);
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  std::uniform_real_distribution<double> place(-0.75, 0.75);
  for (int round = 0; round < 4; ++round) {
    const ConfigurationNumber present = all[random() % all.size()];
    const ObstacleImages images =
        world.See({{{place(random), place(random), 0.6 * place(random)}, 0.12}}, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      const TestSupport support{.possible_space = &possible};
      const CollisionTest held(world.table, images, {.preset = preset}, support);
      const CollisionTest read(read_table, images, {.preset = preset}, support);
      ASSERT_NO_FATAL_FAILURE(ExpectSameChecks(held, read, SphereWorld::Grid(), 3));
      ASSERT_NO_FATAL_FAILURE(ExpectSameTiles(held, read, index, SphereWorld::Grid()));
    }
  }
  EXPECT_GT(free, 0u);
  EXPECT_GT(occupied, 0u);
}

TEST_F(TableInPlace, MeasuresTheSameClearance) {
  const std::vector<MaskSize> sizes = RandomSizes(3, random);
  const RobotImageTable held_table = RandomTable(Grid(), sizes, 0.02, random);
  const RobotImageTable read_table = ReadFrom(held_table);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.02, random);
  const DistanceImages distances = DistancesTo(ObstaclePlanes(images));
  const CollisionTest held(held_table, images, {});
  const CollisionTest read(read_table, images, {});
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

// A disk that fails now and then: a path is free only if all of its places were.
TEST_F(TableInPlace, PathWithAPlaceThatCouldNotBeReadIsNotFree) {
  const ConfigurationGrid grid = Grid();
  const std::vector<MaskSize> sizes = {{8, 8}};
  const RobotImageTable held = RandomTable(grid, sizes, 0, random);
  std::mt19937 failures(seed);
  RobotImageTable::Builder builder(grid, sizes,
                                   [&](ConfigurationNumber number, std::span<uint64_t> words) {
                                     return failures() % 30 != 0 && held.Read(number, words);
                                   });
  std::vector<uint64_t> words(held.words());
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (grid.Contains(number)) builder.Add(number, words);
  }
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImages images = RandomObstacleImages(sizes, 0.1, random);
  const DistanceImages distances = DistancesTo(ObstaclePlanes(images));
  const CollisionTest test(table, images, {});
  const ClearanceMeter meter(test, images, {}, {}, distances);
  int free_paths = 0;
  int other_paths = 0;
  std::vector<ViewEvidence> evidence(1);
  for (int i = 0; i < 300; ++i) {
    const Configuration from = grid.At(grid.NumberOf({static_cast<int>(random() % 18), 3, 2}));
    Configuration to = from;
    to[0] += 0.1;
    bool all_free = true;
    std::optional<PathClearance> clearance;
    const std::vector<Configuration> path = {from, to};
    const PathVerdict verdict = test.CheckPath(path, evidence, [&](const TestedPlace& place) {
      all_free = all_free && place.verdict.free();
      meter.Narrow(place, clearance);
    });
    ASSERT_EQ(verdict.verdict.free(), all_free);
    (all_free ? free_paths : other_paths) += 1;
    // Images without a pixel have no clearance; one that was not read counts as touching.
    if (clearance) {
      ASSERT_TRUE(clearance->squared == 0 || clearance->squared == DistanceImage::kInfinite);
    }
  }
  EXPECT_GT(free_paths, 0);
  EXPECT_GT(other_paths, 0);
}

// Every robot image is empty and nothing is in the way: all that is not free was not read.
TEST_F(TableInPlace, WhatCannotBeReadIsUnknownAndCorrupt) {
  const ConfigurationGrid grid = Grid();
  const std::vector<MaskSize> sizes = {{8, 8}, {9, 7}};
  const RobotImageTable held = RandomTable(grid, sizes, 0, random);
  std::set<uint64_t> lost;
  while (lost.size() < 100) {
    const ConfigurationNumber number = random() % grid.number_limit();
    if (grid.Contains(number)) lost.insert(number);
  }
  const RobotImageTable table = ReadFrom(held, lost);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.1, random);
  const EpipolarBands bands(RandomCalibration(2, 0, random), sizes, 0.3);
  for (const Preset preset : {Preset::kUncalibrated, Preset::kPaper, Preset::kPaperCalibrated}) {
    const CollisionTest test(table, images, {.preset = preset}, {.bands = &bands});
    const TileVerdicts tile = test.CheckTile(0);
    for (ConfigurationNumber number = 0; number < kTileSize; ++number) {
      const Verdict verdict = test.Check(number);
      const bool expected = grid.Contains(number) && !lost.contains(number);
      ASSERT_EQ(verdict.free(), expected) << number;
      ASSERT_EQ(PlaceSet{tile.free}.Contains(number), expected) << number;
      ASSERT_FALSE(PlaceSet{tile.occupied}.Contains(number));
      if (!lost.contains(number)) continue;
      ASSERT_EQ(verdict, Verdict::Unknown(Reason::kRobotImageCorrupt));
      ASSERT_EQ(test.TestRobotImages(grid.At(number)), std::nullopt);
      ASSERT_EQ(table.Images(number), std::nullopt);
    }
    for (int i = 0; i < 200; ++i) {
      const Configuration q = AnyConfiguration(grid);
      const CellCorners corners = grid.CornersAround(q);
      bool readable = corners.count() > 0;
      for (const ConfigurationNumber corner : corners.numbers()) {
        readable = readable && !lost.contains(corner);
      }
      ASSERT_EQ(test.Check(q).free(), readable);
    }
  }
}

TEST_F(TableInPlace, WhatCannotBeReadIsUnknownWhereTheIndexLeavesItOpen) {
  uint64_t lost_and_open = 0;
  for (int round = 0; round < 10; ++round) {
    const std::vector<MaskSize> sizes = RandomSizes(3, random);
    const RobotImageTable held_table = TableWithGaps(Grid(), sizes, random);
    std::set<uint64_t> lost;
    while (lost.size() < 300) lost.insert(random() % Grid().number_limit());
    const RobotImageTable read_table = ReadFrom(held_table, lost);
    const IndexOfTable index(held_table);
    const EpipolarBands bands(RandomCalibration(3, 0, random), sizes, 0.3);
    const ObstacleImages images = RandomBoxScene(sizes, false, random);
    const Policy policy{.preset = Preset::kPaperCalibrated,
                        .epipolar = EpipolarDomain::kIntersection};
    const CollisionTest held(held_table, images, policy, {.bands = &bands});
    const CollisionTest read(read_table, images, policy, {.bands = &bands});
    const SpaceTest held_space(held, index.trees());
    const SpaceTest read_space(read, index.trees());
    for (uint64_t tile = 0; tile < Grid().tiles(); ++tile) {
      PlaceSet unreadable;
      for (const uint64_t number : lost) {
        if (number / kTileSize == tile) unreadable.Insert(number % kTileSize);
      }
      unreadable &= held_space.Open(index.tile(tile));
      unreadable &= held_table.present(tile);
      for (const uint64_t word : unreadable.words) lost_and_open += std::popcount(word);
      const TileVerdicts all = held_space.CheckTile(tile, index.tile(tile));
      PlaceSet expected_free{all.free};
      PlaceSet expected_occupied{all.occupied};
      expected_free -= unreadable;
      expected_occupied -= unreadable;
      const TileVerdicts some = read_space.CheckTile(tile, index.tile(tile));
      ASSERT_EQ(some.free, expected_free.words);
      ASSERT_EQ(some.occupied, expected_occupied.words);
    }
  }
  EXPECT_GT(lost_and_open, 0u);
}

}  // namespace
}  // namespace silhouette
