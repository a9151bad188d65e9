// SPDX-License-Identifier: Apache-2.0
// Clearance levels that are shared by everybody who asks for the same ones.
#include "server/service/space_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <span>
#include <thread>
#include <vector>

#include "tests/server/scene/drawn_scene.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

// A scene as a server has it.
Served ServedScene(const std::shared_ptr<const ServedDatabase>& database, uint64_t id) {
  const Moment now{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};
  absl::StatusOr<Scene> scene = MakeScene(*database, SceneWithHighBlock(3), {}, {}, now);
  EXPECT_TRUE(scene.ok()) << scene.status();
  scene->id = id;
  return {database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone};
}

struct ClearanceCacheTest : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase();
  const Served served = ServedScene(database, 1);
  SpaceCache spaces;

  std::shared_ptr<const ClearanceSpace> Get(ClearanceCache& cache, const Served& of,
                                            const std::vector<double>& levels) {
    return cache.Get(of, {}, spaces.Get(of, {}), levels);
  }
};

TEST_F(ClearanceCacheTest, TheSameLevelsOfTheSameSceneAreShared) {
  ClearanceCache cache;
  const auto space = Get(cache, served, {1, 2});
  EXPECT_NE(Get(cache, served, {1}), space);
  EXPECT_EQ(Get(cache, served, {1, 2}), space);
  EXPECT_NE(cache.Get(served, {.min_views = 1}, spaces.Get(served, {.min_views = 1}), {1, 2}),
            space);
  const Served newer = ServedScene(database, 2);
  EXPECT_NE(Get(cache, newer, {1, 2}), space);
  EXPECT_EQ(space.use_count(), 1) << "the older scene's is not kept";
}

TEST_F(ClearanceCacheTest, MemoryIsBounded) {
  ClearanceCache cache(3 * 512);  // the grid has one tile
  const auto first = Get(cache, served, {1});
  const auto second = Get(cache, served, {1, 2});
  EXPECT_EQ(Get(cache, served, {1}), first);
  Get(cache, served, {3});
  EXPECT_EQ(Get(cache, served, {1}), first) << "both are small";
  EXPECT_NE(Get(cache, served, {1, 2}), second) << "nobody asked for it for long";
  const auto large = Get(cache, served, {1, 2, 3, 4});
  EXPECT_EQ(Get(cache, served, {1, 2, 3, 4}), large) << "the last one is kept whatever its size";
}

TEST_F(ClearanceCacheTest, ManyThreadsSeeTheSameTiles) {
  ClearanceCache cache;
  const auto alone = Get(cache, served, {0, 1, 2, 3});
  const std::vector<PlaceSet> expected(alone->tile(0).begin(), alone->tile(0).end());
  for (int round = 0; round < 20; ++round) {
    const Served again = ServedScene(database, 2 + static_cast<uint64_t>(round));
    std::vector<std::jthread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        const auto space = Get(cache, again, {0, 1, 2, 3});
        const std::span<const PlaceSet> tile = space->tile(0);
        EXPECT_TRUE(std::ranges::equal(tile, expected));
        EXPECT_TRUE(space->ready(0));
      });
    }
  }
}

using SpaceCacheTest = DrawnSoundTest;

TEST_F(SpaceCacheTest, SoundMapsAreSharedOnlyIfAsManyViewsMayBeOccluded) {
  const Served served = ServedScene(InputOf(Any(), {}));
  SpaceCache spaces;
  const auto map = spaces.Get(served, {.preset = Preset::kSound});
  EXPECT_EQ(spaces.Get(served, {.preset = Preset::kSound, .max_occluded_views = 1}), map);
  EXPECT_NE(spaces.Get(served, {.preset = Preset::kSound, .max_occluded_views = 2}), map);
}

}  // namespace
}  // namespace silhouette
