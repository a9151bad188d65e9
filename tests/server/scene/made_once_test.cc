// SPDX-License-Identifier: Apache-2.0
#include "server/scene/made_once.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>

namespace silhouette {
namespace {

TEST(TilesMadeOnce, WhatWasGivenUpOrFailedIsMadeByTheNextWhoAsks) {
  const TilesMadeOnce<int> tiles(2);
  EXPECT_EQ(tiles.Get(1, nullptr, [](uint64_t) { return std::optional<int>(); }), nullptr);
  EXPECT_FALSE(tiles.ready(1));
  const auto fail = [](uint64_t) -> std::optional<int> { throw std::runtime_error("no"); };
  EXPECT_THROW(tiles.Get(1, nullptr, fail), std::runtime_error);
  EXPECT_FALSE(tiles.ready(1));
  EXPECT_EQ(*tiles.Get(1, nullptr, [](uint64_t tile) { return std::optional(7 + int(tile)); }), 8);
  EXPECT_TRUE(tiles.ready(1));
  EXPECT_EQ(*tiles.Get(
                1, [] { return true; }, fail),
            8)
      << "it is there";
  EXPECT_FALSE(tiles.ready(0));
}

TEST(TilesMadeOnce, WhoWaitsForAnotherMayGiveUp) {
  const TilesMadeOnce<int> tiles(1);
  std::atomic<bool> making = false;
  std::atomic<bool> given_up = false;
  std::jthread maker([&] {
    tiles.Get(0, nullptr, [&](uint64_t) {
      making = true;
      given_up.wait(false);
      return std::optional(1);
    });
  });
  while (!making) std::this_thread::yield();
  const auto never = [](uint64_t) -> std::optional<int> { throw std::runtime_error("two"); };
  EXPECT_EQ(tiles.Get(
                0, [] { return true; }, never),
            nullptr);
  given_up = true;
  given_up.notify_all();
  EXPECT_EQ(*tiles.Get(0, nullptr, never), 1);
}

}  // namespace
}  // namespace silhouette
