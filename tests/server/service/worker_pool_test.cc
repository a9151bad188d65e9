// SPDX-License-Identifier: Apache-2.0
#include "server/service/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <string>
#include <thread>
#include <vector>

namespace silhouette {
namespace {

TEST(WorkerPool, RunsAllTasksBeforeItEnds) {
  std::atomic<int> done = 0;
  {
    WorkerPool pool({.name = "test", .threads = 3, .queue = 1000, .queue_per_client = 1000});
    for (int i = 0; i < 500; ++i) EXPECT_TRUE(pool.Run("client", 0, [&done] { ++done; }));
  }
  EXPECT_EQ(done, 500);
}

TEST(WorkerPool, TurnsTasksAwayWhenTheQueueIsFull) {
  std::latch started(1);
  std::latch release(1);
  std::atomic<int> done = 0;
  {
    WorkerPool pool({.name = "test", .queue = 2});
    EXPECT_TRUE(pool.Run("client", 0, [&] {
      started.count_down();
      release.wait();
    }));
    started.wait();
    EXPECT_TRUE(pool.Run("client", 0, [&done] { ++done; }));
    EXPECT_TRUE(pool.Run("client", 0, [&done] { ++done; }));
    EXPECT_FALSE(pool.Run("client", 0, [&done] { ++done; }));
    release.count_down();
  }
  EXPECT_EQ(done, 2);
}

TEST(WorkerPool, TakesTheTasksOfClientsInTurn) {
  std::latch started(1);
  std::latch release(1);
  std::string order;
  {
    WorkerPool pool({.name = "test"});
    EXPECT_TRUE(pool.Run("a", 0, [&] {
      started.count_down();
      release.wait();
    }));
    started.wait();
    for (int i = 0; i < 5; ++i) EXPECT_TRUE(pool.Run("a", 0, [&order] { order += 'a'; }));
    for (int i = 0; i < 2; ++i) EXPECT_TRUE(pool.Run("b", 0, [&order] { order += 'b'; }));
    release.count_down();
  }
  EXPECT_EQ(order, "ababaaa");
}

TEST(WorkerPool, BoundsTheTasksOfAClientAndTheBytesOfAll) {
  std::latch started(1);
  std::latch release(1);
  WorkerPool pool({.name = "test", .queue = 10, .queue_per_client = 2, .queued_bytes = 100});
  EXPECT_TRUE(pool.Run("a", 90, [&] {
    started.count_down();
    release.wait();
  }));
  started.wait();  // its bytes wait no longer
  EXPECT_TRUE(pool.Run("a", 40, [] {}));
  EXPECT_TRUE(pool.Run("a", 40, [] {}));
  EXPECT_FALSE(pool.Run("a", 0, [] {}));
  EXPECT_FALSE(pool.Run("b", 21, [] {}));
  EXPECT_TRUE(pool.Run("b", 20, [] {}));
  release.count_down();
}

TEST(WorkerPool, TakesTheServersOwnTaskThoughTheQueueIsFull) {
  std::latch started(1);
  std::latch release(1);
  std::string order;
  {
    WorkerPool pool({.name = "test", .queue = 2, .queue_per_client = 2, .queued_bytes = 100});
    EXPECT_TRUE(pool.Run("a", 0, [&] {
      started.count_down();
      release.wait();
    }));
    started.wait();
    EXPECT_TRUE(pool.Run("a", 50, [&order] { order += 'a'; }));
    EXPECT_TRUE(pool.Run("a", 50, [&order] { order += 'a'; }));
    EXPECT_FALSE(pool.Run("b", 0, [] {}));
    EXPECT_TRUE(pool.Run(WorkerPool::kServer, 0, [&order] { order += 's'; }));
    EXPECT_TRUE(pool.Run(WorkerPool::kServer, 0, [&order] { order += 's'; }));
    EXPECT_FALSE(pool.Run(WorkerPool::kServer, 0, [] {})) << "they do not pile up";
    release.count_down();
  }
  EXPECT_EQ(order, "asas");
}

TEST(WorkerPool, FinishRunsWhatWaitsAndTakesNoMore) {
  int done = 0;
  WorkerPool pool({.name = "test"});
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(pool.Run("client", 0, [&done] { ++done; }));
  pool.Finish();
  EXPECT_EQ(done, 20);
  EXPECT_FALSE(pool.Run("client", 0, [&done] { ++done; }));
  EXPECT_EQ(done, 20);
}

TEST(WorkerPool, TakesTasksFromManyThreads) {
  std::atomic<int> done = 0;
  {
    WorkerPool pool({.name = "test", .threads = 2, .queue = 10'000, .queue_per_client = 10'000});
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        for (int j = 0; j < 200; ++j) pool.Run("client", 0, [&done] { ++done; });
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  EXPECT_EQ(done, 800);
}

}  // namespace
}  // namespace silhouette
