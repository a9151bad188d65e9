// SPDX-License-Identifier: Apache-2.0
// Watches and streams while scenes, regions and databases change.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

// Odd scenes have a block on the way of (3, 0), even ones have none.
void PublishScenes(TestServer& server, uint64_t last) {
  for (uint64_t scene = 1; scene <= last; ++scene) {
    server.Publish(scene % 2 == 1 ? SceneWithBlock(3) : EmptyCellScene());
  }
}

TEST(WatchThreads, EveryUpdateIsOfTheSceneItNames) {
  constexpr uint64_t kScenes = 60;
  const auto database = NewDatabase({.index = true});
  TestServer server(database);
  const uint64_t number = database->grid().NumberOf({3, 0});
  const auto bit = [number](const std::string& bits) {
    return (bits[number / 8] >> (number % 8) & 1) != 0;
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < 3; ++i) {
    threads.emplace_back([&] {
      SpaceWatching watching(server);
      uint64_t told = 0;
      while (told < kScenes && !::testing::Test::HasFailure()) {
        const uint64_t scene = watching.Next().first.basis().scene_id();
        if (scene == 0) continue;
        EXPECT_GE(scene, told);
        told = scene;
        EXPECT_EQ(bit(watching.free().at(0)), scene % 2 == 0);
      }
    });
    threads.emplace_back([&] {
      PathWatching watching(server, {At(3, 0)});
      uint64_t told = 0;
      while (told < kScenes && !::testing::Test::HasFailure()) {
        const v1::CheckPathResponse check = watching.Next().check();
        told = check.basis().scene_id();
        if (told == 0) continue;
        EXPECT_EQ(check.verdict().state() == v1::Verdict::STATE_FREE, told % 2 == 0);
      }
    });
    threads.emplace_back([&] {
      Asking asking(server);
      uint64_t told = 0;
      while (told < kScenes && !::testing::Test::HasFailure()) {
        asking.Send(told, At(3, 0));
        const auto check = asking.Next().configurations();
        told = check.basis().scene_id();
        if (told == 0) continue;
        EXPECT_EQ(check.verdicts(0).state() == v1::Verdict::STATE_FREE, told % 2 == 0);
      }
    });
  }
  PublishScenes(server, kScenes);
  for (std::thread& thread : threads) thread.join();
}

TEST(WatchThreads, CallersComeAndGoWhileTheServerStops) {
  ServingSettings settings;
  settings.limits.streams_per_client = 1000;  // more than all rounds begin: some end late
  TestServer server(NewDatabase({.index = true}), settings);
  std::atomic<bool> stopped = false;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int round = 0; round < 20 && !stopped; ++round) {
        SpaceWatching space(server);
        PathWatching path(server, {At(0, 0), At(4, 0)});
        Asking asking(server);
        asking.SendIfItCan(1, At(0, 0));
        if (i % 2 == 0) space.Cancel();
        const grpc::StatusCode code = space.Finish().error_code();
        EXPECT_TRUE(code == grpc::StatusCode::UNAVAILABLE || code == grpc::StatusCode::CANCELLED)
            << code;
      }
    });
  }
  PublishScenes(server, 50);
  server.server->Stop(absl::Seconds(100));
  stopped = true;
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace silhouette
