// SPDX-License-Identifier: Apache-2.0
// Robot images that cannot be read when they are needed: nothing is free that takes one.
#include <gtest/gtest.h>

#include <bit>
#include <set>
#include <vector>

#include "server/collision/clearance.h"
#include "server/collision/collision_checker.h"
#include "server/collision/space_checker.h"
#include "tests/server/collision/index_of_table.h"
#include "tests/server/collision/random_geometry.h"
#include "tests/server/collision/table_in_place.h"

namespace silhouette {
namespace {

// A disk that fails now and then: a path is free only if all of its places were.
TEST_F(TableInPlace, PathWithAPlaceThatCouldNotBeReadIsNotFree) {
  const ConfigurationGrid grid = Grid();
  const std::vector<MaskSize> sizes = {{8, 8}};
  const RobotImageTable held = RandomTable(grid, sizes, 0, random);
  std::mt19937_64 failures(random());
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
  const CollisionChecker test(table, images, {});
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
    const PathVerdict verdict =
        test.CheckPath(path, evidence, {.tested = [&](const TestedPlace& place) {
                         all_free = all_free && place.verdict.free();
                         meter.Narrow(place, clearance);
                       }});
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
    const CollisionChecker test(table, images, {.preset = preset}, {.bands = &bands});
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
    const Policy policy{.preset = Preset::kCalibrated};
    const CollisionChecker held(held_table, images, policy, {.bands = &bands});
    const CollisionChecker read(read_table, images, policy, {.bands = &bands});
    const SpaceChecker held_space(held, index.trees());
    const SpaceChecker read_space(read, index.trees());
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
