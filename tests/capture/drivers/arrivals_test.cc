// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/opencv/arrivals.h"

#include <gtest/gtest.h>

#include <random>

namespace silhouette {
namespace {

constexpr double kInterval = 0.04;
constexpr double kLatency = 0.5;

// A stream of an image every 40 ms, which arrives up to 10 ms earlier or later.
struct ArrivalsTest : testing::Test {
  Arrivals arrivals{absl::Seconds(kLatency)};
  std::mt19937 random{1};
  double now = 0;

  bool Trusted() const { return absl::Seconds(now) >= arrivals.late_until(); }
  void Arrive(double at) {
    now = at;
    arrivals.Note(absl::Seconds(at));
  }
  void RunFor(double seconds) {
    std::uniform_real_distribution<double> jitter(-0.01, 0.01);
    const double begin = now;
    for (double at = kInterval; at < seconds; at += kInterval) Arrive(begin + at + jitter(random));
  }
};

TEST_F(ArrivalsTest, ImagesOfASteadyStreamAreTrusted) {
  RunFor(2);
  for (int i = 0; i < 100; ++i) {
    RunFor(1);
    EXPECT_TRUE(Trusted()) << i;
  }
}

TEST_F(ArrivalsTest, WhatPiledUpInAPauseIsNotTakenForNew) {
  for (const double pause : {0.3, 1.0, 2.5, 5.0}) {
    for (const double decoding : {0.001, 0.005, 0.015}) {
      RunFor(3);
      ASSERT_TRUE(Trusted());
      // All images since the pause began are waiting, and more come while they are read.
      double taken = now;
      const double ends = now + pause;
      double at = ends;
      for (; taken + kInterval < at; at += decoding) {
        taken += kInterval;
        Arrive(at);
        if (at - taken > kLatency) {
          ASSERT_FALSE(Trusted()) << pause << " " << decoding << " " << at - taken;
        }
      }
      RunFor(2);
      EXPECT_TRUE(Trusted()) << pause << " " << decoding;
    }
  }
}

TEST_F(ArrivalsTest, StreamThatBeginsWithABurstIsTrustedSoon) {
  for (int i = 0; i < 20; ++i) Arrive(0.001 * i);
  RunFor(3);
  EXPECT_TRUE(Trusted());
}

TEST_F(ArrivalsTest, SlowerStreamIsTrustedOnceItIsTheUsual) {
  RunFor(3);
  for (int i = 0; i < 60; ++i) Arrive(now + 0.2);
  EXPECT_TRUE(Trusted());
}

}  // namespace
}  // namespace silhouette
