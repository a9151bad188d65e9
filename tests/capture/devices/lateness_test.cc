// SPDX-License-Identifier: Apache-2.0
#include "capture/devices/lateness.h"

#include <gtest/gtest.h>

#include <random>

namespace silhouette {
namespace {

constexpr double kInterval = 0.04;
constexpr double kJitter = 0.03;

// An image every 40 ms, which is under way for up to 30 ms longer than the quickest.
struct LatenessTest : testing::Test {
  Lateness lateness;
  std::mt19937 random{1};
  double taken = 0;

  // Of the next image, held up for `held_up`, by a clock that begins a year before this one.
  // Infinite: not known.
  double Next(double held_up = 0) {
    taken += kInterval;
    const double jitter = std::uniform_real_distribution<double>(0, kJitter)(random);
    return absl::ToDoubleSeconds(
        lateness.Of(absl::Seconds(taken), absl::Seconds(3e7 + taken + held_up + jitter))
            .value_or(absl::InfiniteDuration()));
  }
  void Begin() {
    for (int i = 0; i < 50; ++i) Next();
  }
};

TEST_F(LatenessTest, SteadyStreamIsLateByNoMoreThanItsDelaysVary) {
  Begin();
  for (int i = 0; i < 10000; ++i) EXPECT_LE(Next(), kJitter);
}

TEST_F(LatenessTest, WhatPiledUpIsKnownToBeOldHoweverSlowlyItIsDelivered) {
  Begin();
  for (const double drained : {10.0, 0.3, 0.04, 0.005, 0.0}) {  // seconds per second
    double held_up = 3;
    for (int i = 0; i < 1000 && held_up > 0; ++i) {
      EXPECT_GT(Next(held_up), held_up - 0.1) << drained;
      held_up -= drained * kInterval;
    }
    Next();
    EXPECT_LE(Next(), kJitter);
  }
}

TEST_F(LatenessTest, StreamThatFallsBehindIsKnownTo) {
  Begin();
  double held_up = 0;
  for (; held_up < 2; held_up += 0.02 * kInterval)
    EXPECT_GT(Next(held_up), 0.9 * held_up - kJitter);
}

TEST_F(LatenessTest, WhatHadPiledUpWhenAStreamBeginsIsNotTakenForNew) {
  for (const double reading : {0.0, 0.001, 0.015}) {  // seconds an image
    lateness = {};
    for (double held_up = 2; held_up > 0; held_up -= kInterval - reading) {
      taken += kInterval;
      EXPECT_FALSE(lateness.Of(absl::Seconds(taken), absl::Seconds(taken + held_up))) << reading;
    }
    taken += kInterval;
    lateness.Of(absl::Seconds(taken), absl::Seconds(taken));
    taken += kInterval;
    EXPECT_TRUE(lateness.Of(absl::Seconds(taken), absl::Seconds(taken)));
  }
}

TEST_F(LatenessTest, ClocksMayRunApart) {
  Begin();
  for (int i = 0; i < 100000; ++i) EXPECT_LE(Next(5e-4 * taken), kJitter);
}

}  // namespace
}  // namespace silhouette
