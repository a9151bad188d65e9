// SPDX-License-Identifier: Apache-2.0
// Maps that are replaced while threads read them.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "clients/cpp/published.h"
#include "silhouette/local_space.h"
#include "tests/clients/cpp/watched_space.h"

namespace silhouette::client {
namespace {

// Both numbers are the same as long as it lives.
struct Twin : std::enable_shared_from_this<Twin> {
  explicit Twin(int number) : first(number), second(number) {}
  ~Twin() { second = -1; }
  int first;
  int second;
};

TEST(Published, ReadersSeeOneValueWholeAndNeverAnOlderOneAfterwards) {
  Published<Twin> published(std::make_shared<const Twin>(0));
  std::atomic<bool> over = false;
  std::atomic<int> wrong = 0;
  std::atomic<int> reading = 0;
  std::vector<std::jthread> readers;
  for (int t = 0; t < 3; ++t) {
    readers.emplace_back([&, t] {
      int last = 0;
      ++reading;
      while (!over) {
        const auto check = [&](const Twin& twin) {
          if (twin.first != twin.second || twin.first < last) ++wrong;
          return twin.first;
        };
        last = t == 0 ? check(*published.Get()) : published.With(check);
      }
    });
  }
  while (reading < 3) std::this_thread::yield();
  for (int i = 1; i <= 3000; ++i) published.Replace(std::make_shared<const Twin>(i));
  over = true;
  readers.clear();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(published.Get()->first, 3000);
}

TEST(LocalSpaceThreads, ASnapshotIsOfOneScene) {
  WatchedServer server;
  const LocalSpace space(ClientOfHere(server.fake), {.max_age = absl::Minutes(1)});
  server.Send(FirstUpdate(BasisOf(1)));
  const auto first = space.WaitForUpdate(0, absl::Seconds(20));
  ASSERT_EQ(first->unknown_reason(), std::nullopt);
  constexpr uint64_t kLast = 150;
  std::atomic<int> mixed = 0;
  std::vector<std::jthread> readers;
  for (int t = 0; t < 3; ++t) {
    readers.emplace_back([&] {
      for (uint64_t scene = 1; scene < kLast;) {
        const auto snapshot = space.Snapshot();
        scene = snapshot->basis().scene_id;
        // Tiles 0 and 2 are free in scenes of odd numbers.
        const State expected = scene % 2 == 1 ? State::kFree : State::kOccupied;
        if (snapshot->StateAt(0) != expected || snapshot->StateAt(2 * kTileSize) != expected) {
          ++mixed;
        }
        if (space.StateAt(0) == State::kUnknown) ++mixed;
        if (space.Check({0, 0}).state == State::kUnknown) ++mixed;
      }
    });
  }
  for (uint64_t scene = 2; scene <= kLast + 1; ++scene) {
    SpacePart part = Update(BasisOf(scene));
    AddTile(part, 0, scene % 2 == 1);
    AddTile(part, 2, scene % 2 == 1);
    server.Send(part);
  }
  readers.clear();
  EXPECT_EQ(mixed, 0);
}

}  // namespace
}  // namespace silhouette::client
