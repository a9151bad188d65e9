// SPDX-License-Identifier: Apache-2.0
// Scenes published, replaced and judged by several threads at once, without gRPC in between.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "server/scene/checker.h"
#include "server/scene/scene_store.h"
#include "server/service/space_cache.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

const Moment kNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

// Scenes with odd ids have a block on the way of (3, 0), those with even ids have none.
SharedScene PublishNext(SceneStore& store, const std::shared_ptr<const ServedDatabase>& database,
                        bool block) {
  absl::StatusOr<Scene> scene =
      MakeScene(*database, block ? SceneWithBlock(3) : EmptyCellScene(), {}, {}, kNow);
  EXPECT_TRUE(scene.ok()) << scene.status();
  const absl::StatusOr<SharedScene> published = store.Publish(*std::move(scene), database);
  return published.ok() ? *published : nullptr;
}

TEST(SceneThreads, EveryVerdictBelongsToTheSceneItNames) {
  const auto database = NewDatabase();
  SceneStore store(database, 4);
  SpaceCache spaces;
  PublishNext(store, database, true);
  std::atomic<bool> stop = false;
  std::vector<std::thread> threads;
  for (int i = 0; i < 3; ++i) {
    threads.emplace_back([&, i] {
      while (!stop) {
        const Checker checker(store.Newest(kNow), {}, {}, kNow);
        const bool block = checker.served().scene->id % 2 == 1;
        EXPECT_EQ(checker.Check(At(3, 0)).state(), block ? State::kOccupied : State::kFree);
        const auto space = spaces.Get(checker.served(), {.min_views = 1 + i % 2});
        const uint64_t place = database->grid().NumberOf({3, 0});
        EXPECT_EQ(space->state(place), block ? State::kOccupied : State::kFree);
      }
    });
  }
  for (int i = 2; i < 300; ++i) {
    EXPECT_EQ(PublishNext(store, database, i % 2 == 1)->id, static_cast<uint64_t>(i));
    store.Find(static_cast<uint64_t>(i - 2));
  }
  stop = true;
  for (std::thread& thread : threads) thread.join();
}

TEST(SceneThreads, NoSceneOutlivesItsDatabase) {
  const auto first = NewDatabase();
  const auto second = NewDatabase({.missing = {{1, 1}}});
  SceneStore store(first);
  std::atomic<bool> stop = false;
  std::vector<std::thread> threads;
  for (const auto& database : {first, second}) {
    threads.emplace_back([&store, &stop, database] {
      while (!stop) PublishNext(store, database, false);
    });
  }
  threads.emplace_back([&] {
    while (!stop) {
      const Served served = store.Newest(kNow);
      const Checker checker(served, {}, {}, kNow);
      const Verdict verdict = checker.Check(At(1, 1));
      if (served.scene != nullptr) {
        EXPECT_EQ(served.scene->generation, served.database->generation());
      }
      if (served.database == second) {
        EXPECT_FALSE(verdict.free());
      }
    }
  });
  for (int i = 0; i < 200; ++i) store.ReplaceDatabase(i % 2 == 0 ? second : first);
  stop = true;
  for (std::thread& thread : threads) thread.join();
}

TEST(SceneThreads, RegionsThatComeAndGoLeaveNoVerdictBetween) {
  const auto database = NewDatabase();
  SceneStore store(database, 4);
  SpaceCache spaces;
  PublishNext(store, database, true);
  std::vector<std::optional<Mask>> pixels;
  for (int view = 0; view < 3; ++view) pixels.emplace_back(Block(view, 3));
  std::atomic<bool> stop = false;
  std::vector<std::thread> threads;
  for (int i = 0; i < 3; ++i) {
    threads.emplace_back([&] {
      while (!stop) {
        const Checker checker(store.Newest(kNow), {}, {}, kNow);
        const bool allowed = !checker.RegionsAt(At(3, 0)).empty();
        EXPECT_EQ(allowed, !checker.served().regions->regions.empty());
        EXPECT_EQ(checker.Check(At(3, 0)).state(), allowed ? State::kFree : State::kOccupied);
        const Verdict beside = checker.Check(At(1, 0));
        const std::optional<double> clearance = checker.Clearances()->Measure(At(1, 0), beside);
        EXPECT_EQ(clearance, allowed ? std::numeric_limits<double>::infinity() : 0)
            << "the block stands on the robot's foot";
        const auto space = spaces.Get(checker.served(), {});
        const uint64_t place = database->grid().NumberOf({3, 0});
        EXPECT_EQ(space->state(place), allowed ? State::kFree : State::kOccupied);
      }
    });
  }
  for (int i = 0; i < 200; ++i) {
    EXPECT_TRUE(store.Allow("part", pixels, absl::Seconds(1), kNow, database).ok());
    if (i % 3 == 0) PublishNext(store, database, true);
    EXPECT_TRUE(store.Revoke("part", kNow));
  }
  stop = true;
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace silhouette
