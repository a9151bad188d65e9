// SPDX-License-Identifier: Apache-2.0
// The collision index while several threads build, read and change it.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "db/store/collision_index.h"
#include "tests/db/store/index_checks.h"
#include "tests/db/store/test_database.h"
#include "tests/random.h"

namespace silhouette {
namespace {

TEST(CollisionIndex, StoppedBuildKeepsWhatIsBuiltAndGoesOn) {
  const auto database = MakeFilledDatabase();
  std::vector<uint64_t> told;
  const auto stop_soon = [&](uint64_t done, uint64_t) {
    told.push_back(done);
    return done == 0;
  };
  // A buffer of nothing: a tile at a time.
  const auto first = BuildIndex(*database, {.threads = 1, .buffer = 0, .progress = stop_soon});
  EXPECT_TRUE(first.stopped);
  EXPECT_EQ(told.front(), 0);
  EXPECT_GT(first.built, 0);
  EXPECT_LT(first.built, first.tiles);
  EXPECT_EQ(TilesIn(*database, TileState::kFresh).size(), first.built);
  ExpectIndexHoldsTheRobotImages(*database, false);
  const auto second = BuildIndex(*database);
  EXPECT_EQ(second.built, first.tiles - first.built);
  ExpectIndexHoldsTheRobotImages(*database);
}

// What is fresh is what the records are, while they change under the build.
TEST(CollisionIndex, NeverClaimsRecordsThatItWasNotBuiltFrom) {
  const auto database = MakeFilledDatabase();
  Random random;
  std::atomic<bool> done = false;
  std::jthread changes([&] {
    const std::vector<ConfigurationNumber> numbers = AllNumbers(database->grid());
    while (!done) {
      const ConfigurationNumber number = numbers[random() % numbers.size()];
      PutAll(*database, {TestImage(*database, number, random())}, true);
    }
  });
  for (int i = 0; i < 6; ++i) {
    BuildIndex(*database, {.all = i % 2 == 0});
    ExpectIndexHoldsTheRobotImages(*database, false);
  }
  done = true;
  changes.join();
  ExpectIndexHoldsTheRobotImages(*database, false);
  BuildIndex(*database);
  ExpectIndexHoldsTheRobotImages(*database);
}

TEST(CollisionIndex, IsReadByManyThreadsWhileTheMapGrowsAndTheIndexIsBuiltAnew) {
  const auto database = MakeFilledDatabase();
  BuildIndex(*database);
  const auto index = OpenIndex(*database);
  const auto tiles = ReadTiles(index->snapshot());
  const size_t before = MapSize(*database);
  std::atomic<bool> done = false;
  std::vector<std::jthread> readers;
  for (int i = 0; i < 3; ++i) {
    readers.emplace_back([&] {
      do {
        for (const auto& [tile, images] : tiles) {
          const TileIndex* held = index->Tile(tile);
          ASSERT_NE(held, nullptr);
          for (size_t j = 0; j < images.size(); j += 97) {
            ASSERT_EQ(held->Image(0, images[j].number % kTileSize), images[j].masks[0]);
          }
        }
      } while (!done);
    });
  }
  // Records and index are written again, with further data, until the map grows.
  for (uint64_t round = 1; MapSize(*database) == before; ++round) {
    ASSERT_LT(round, 20);
    for (const auto& [tile, images] : tiles) {
      PutAll(*database, {TestImage(*database, tile * kTileSize, round)}, true);
    }
    PutMuch(*database);
    EXPECT_EQ(BuildIndex(*database).built, tiles.size());
  }
  done = true;
  readers.clear();
  EXPECT_NE(MapSize(*database), before);
  for (const auto& [tile, images] : tiles) {
    ExpectHolds(*index->Tile(tile), index->trees(), images);
  }
  ExpectIndexHoldsTheRobotImages(*database);
}

}  // namespace
}  // namespace silhouette
