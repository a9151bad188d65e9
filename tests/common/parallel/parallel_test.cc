// SPDX-License-Identifier: Apache-2.0
#include "common/parallel/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace silhouette {
namespace {

TEST(ParallelFor, CallsEveryIndexOnce) {
  for (const size_t count : {0, 1, 2, 1000}) {
    std::vector<std::atomic<int>> calls(count);
    ParallelFor(count, [&](size_t i) { ++calls[i]; });
    for (const std::atomic<int>& called : calls) EXPECT_EQ(called, 1);
  }
}

TEST(ParallelFor, UsesThisThreadAloneIfThereMayBeNoOther) {
  std::set<std::thread::id> threads;
  ParallelFor(
      100, [&](size_t) { threads.insert(std::this_thread::get_id()); }, 1);
  EXPECT_EQ(threads, std::set{std::this_thread::get_id()});
}

TEST(ParallelFor, RethrowsAnExceptionAndBeginsNoFurtherCall) {
  std::atomic<int> calls = 0;
  const auto work = [&](size_t) {
    ++calls;
    throw std::runtime_error("no");
  };
  EXPECT_THROW(ParallelFor(1'000'000, work), std::runtime_error);
  EXPECT_LT(calls, 10'000);
}

TEST(ParallelWhile, EndsWhenACallReturnsFalse) {
  std::atomic<size_t> calls = 0;
  EXPECT_FALSE(ParallelWhile(1'000'000, [&](size_t i) { return ++calls, i != 5; }));
  EXPECT_LT(calls, 1'000'000u);
  EXPECT_TRUE(ParallelWhile(10, [](size_t) { return true; }));
}

}  // namespace
}  // namespace silhouette
