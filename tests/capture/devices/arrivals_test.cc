// SPDX-License-Identifier: Apache-2.0
#include "capture/devices/arrivals.h"

#include <gtest/gtest.h>

#include <random>

namespace silhouette {
namespace {

constexpr double kInterval = 0.04;
constexpr double kJitter = 0.01;

// A stream of an image every 40 ms, which arrives up to 10 ms earlier or later.
struct ArrivalsTest : testing::Test {
  Arrivals arrivals;
  std::mt19937 random{1};
  double now = 0;

  double lag() const { return absl::ToDoubleSeconds(arrivals.lag()); }
  void Arrive(double at) {
    now = at;
    arrivals.Note(absl::Seconds(at));
  }
  void RunFor(double seconds, double interval = kInterval) {
    std::uniform_real_distribution<double> jitter(-kJitter, kJitter);
    const double begin = now;
    for (double at = interval; at < seconds; at += interval) Arrive(begin + at + jitter(random));
  }
};

TEST_F(ArrivalsTest, SteadyStreamIsBehindByNoMoreThanItsGapsVaryBy) {
  RunFor(2);
  for (int i = 0; i < 100; ++i) {
    RunFor(1);
    EXPECT_LT(lag(), 4 * kJitter) << i;
  }
}

TEST_F(ArrivalsTest, WhatPiledUpInAPauseIsKnownToBeOld) {
  for (const double pause : {0.3, 1.0, 2.5, 5.0}) {
    for (const double decoding : {0.001, 0.005, 0.015, 0.03}) {
      RunFor(3);
      ASSERT_LT(lag(), 4 * kJitter);
      // All images since the pause began are waiting, and more come while they are read.
      double taken = now;
      for (double at = now + pause; taken + kInterval < at; at += decoding) {
        taken += kInterval;
        Arrive(at);
        ASSERT_GT(lag(), at - taken - 2 * kInterval) << pause << " " << decoding;
      }
      RunFor(2);
      EXPECT_LT(lag(), 4 * kJitter) << pause << " " << decoding;
    }
  }
}

TEST_F(ArrivalsTest, StreamThatBeginsWithABurstIsInTimeSoon) {
  for (int i = 0; i < 20; ++i) Arrive(0.001 * i);
  RunFor(3);
  EXPECT_LT(lag(), 4 * kJitter);
}

TEST_F(ArrivalsTest, SlowerStreamIsInTimeOnceItIsTheUsual) {
  RunFor(3);
  RunFor(20, 0.2);
  EXPECT_LT(lag(), 4 * kJitter);
}

// As a robot's two messages about the same position.
TEST_F(ArrivalsTest, PairsAreInTimeAgainSoonAfterTheDevicePaused) {
  const auto run = [&](int pairs) {
    for (int i = 0; i < pairs; ++i) {
      Arrive(now + kInterval);
      Arrive(now);
    }
  };
  run(100);
  EXPECT_LT(lag(), kInterval);
  now += 5;
  run(40);
  EXPECT_LT(lag(), kInterval);
}

TEST_F(ArrivalsTest, ClockThatStepsBackCountsAsStandingStill) {
  RunFor(3);
  now -= 3600;
  RunFor(3);
  EXPECT_LT(lag(), 4 * kJitter);
}

}  // namespace
}  // namespace silhouette
