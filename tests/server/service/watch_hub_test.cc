// SPDX-License-Identifier: Apache-2.0
#include "server/service/watch_hub.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "server/service/map_keeper.h"
#include "tests/server/service/test_server.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

// Counts what it is told.
class NotingWatcher final : public Watcher {
 public:
  void Tell(uint64_t version) override { told = version; }
  void End() override { ended = true; }

  // Waits until something newer than `version` is told.
  uint64_t After(uint64_t version) const {
    while (told == version) std::this_thread::yield();
    return told;
  }

  std::atomic<uint64_t> told = 0;
  std::atomic<bool> ended = false;
};

class WatchHubTest : public ::testing::Test {
 protected:
  void Publish(const SceneInput& input = EmptyCellScene()) {
    absl::StatusOr<Scene> scene = MakeScene(*database, input, {}, {}, clock.clock()());
    ASSERT_TRUE(scene.ok()) << scene.status();
    ASSERT_TRUE(scenes.Publish(*std::move(scene), database).ok());
  }

  std::shared_ptr<const ServedDatabase> database = NewDatabase({.index = true});
  TestClock clock;
  SceneStore scenes{database};
  WatchHub hub{scenes, {}, clock.clock()};
  std::shared_ptr<NotingWatcher> listener = std::make_shared<NotingWatcher>();
};

TEST_F(WatchHubTest, TellsEveryChange) {
  hub.Add(listener);
  uint64_t told = listener->After(0);
  Publish();
  told = listener->After(told);
  std::vector<std::optional<Mask>> pixels(3);
  pixels[0] = Block(0, 3);
  ASSERT_TRUE(
      scenes.Allow("part", pixels, absl::Milliseconds(100), clock.clock()(), database).ok());
  told = listener->After(told);
  clock.Advance(absl::Milliseconds(100));  // the region ends
  told = listener->After(told);
  clock.Advance(absl::Seconds(1));  // the scene is too old
  told = listener->After(told);
  scenes.ReplaceDatabase(NewDatabase());
  listener->After(told);
}

TEST_F(WatchHubTest, TellsNothingNewIfNothingChanges) {
  Publish();
  hub.Add(listener);
  const uint64_t told = listener->After(0);
  clock.Advance(absl::Milliseconds(500));  // the scene is still good
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(listener->told, told);
}

TEST_F(WatchHubTest, ForgetsWhoIsGone) {
  hub.Add(listener);
  EXPECT_EQ(hub.watchers(), 1u);
  listener = nullptr;
  while (hub.watchers() != 0) std::this_thread::yield();  // the hub may just be telling it
}

TEST_F(WatchHubTest, EndsWhoWaitsAndWhoComesLate) {
  hub.Add(listener);
  hub.Close();
  EXPECT_TRUE(listener->ended);
  const auto late = std::make_shared<NotingWatcher>();
  hub.Add(late);
  EXPECT_TRUE(late->ended);
}

// The map of the newest scene under the default policy, and how many of its tiles are there.
TEST_F(WatchHubTest, KeeperWorksTheDefaultMapOutBeforeAnybodyAsks) {
  ServingSettings settings;
  settings.clock = clock.clock();
  settings.map_time = absl::Seconds(10);
  SpaceCache spaces;
  const auto keeper = std::make_shared<MapKeeper>(settings, scenes, spaces);
  hub.Add(keeper);
  Publish(SceneWithBlock(3));
  const auto space = spaces.Get(scenes.Newest(clock.clock()()), settings.policy);
  while (!space->ready(0)) std::this_thread::yield();
  EXPECT_EQ(space->state(database->grid().NumberOf({3, 0})), State::kOccupied);
}

TEST_F(WatchHubTest, KeeperLeavesWhatMustBeTestedSinglyToThoseWhoAsk) {
  database = NewDatabase();  // no index
  scenes.ReplaceDatabase(database);
  ServingSettings settings;
  settings.clock = clock.clock();
  settings.map_time = absl::Seconds(10);
  SpaceCache spaces;
  const auto keeper = std::make_shared<MapKeeper>(settings, scenes, spaces);
  hub.Add(keeper);
  hub.Add(listener);
  const uint64_t told = listener->After(0);
  Publish(SceneWithBlock(3));
  listener->After(told);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(spaces.Get(scenes.Newest(clock.clock()()), settings.policy)->ready(0));
}

}  // namespace
}  // namespace silhouette
