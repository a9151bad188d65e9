// SPDX-License-Identifier: Apache-2.0
#include "server/service/serving.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>

namespace silhouette {
namespace {

TEST(WorkerPool, RunsAllTasksBeforeItEnds) {
  std::atomic<int> done = 0;
  {
    WorkerPool pool(3, 1000);
    for (int i = 0; i < 500; ++i) EXPECT_TRUE(pool.Run([&done] { ++done; }));
  }
  EXPECT_EQ(done, 500);
}

TEST(WorkerPool, TurnsTasksAwayWhenTheQueueIsFull) {
  std::latch started(1);
  std::latch release(1);
  std::atomic<int> done = 0;
  {
    WorkerPool pool(1, 2);
    EXPECT_TRUE(pool.Run([&] {
      started.count_down();
      release.wait();
    }));
    started.wait();
    EXPECT_TRUE(pool.Run([&done] { ++done; }));
    EXPECT_TRUE(pool.Run([&done] { ++done; }));
    EXPECT_FALSE(pool.Run([&done] { ++done; }));
    release.count_down();
  }
  EXPECT_EQ(done, 2);
}

TEST(WorkerPool, TakesTasksFromManyThreads) {
  std::atomic<int> done = 0;
  {
    WorkerPool pool(2, 10'000);
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        for (int j = 0; j < 200; ++j) pool.Run([&done] { ++done; });
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  EXPECT_EQ(done, 800);
}

}  // namespace
}  // namespace silhouette
