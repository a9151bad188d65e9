// SPDX-License-Identifier: Apache-2.0
#include "capture/devices/lateness.h"

#include <gtest/gtest.h>

#include <limits>
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
  double Next(double held_up = 0) {
    taken += kInterval;
    const double jitter = std::uniform_real_distribution<double>(0, kJitter)(random);
    return absl::ToDoubleSeconds(
        lateness.Of(absl::Seconds(taken), absl::Seconds(3e7 + taken + held_up + jitter)));
  }
  void Begin() {
    for (int i = 0; i < 50; ++i) Next();
  }
  // How much time of the stream passes until the quickest is known; infinite: more than 10 s.
  double TimeToSettle() {
    const double begin = taken;
    for (int i = 0; i < 250; ++i) {
      Next();
      if (lateness.settled()) return taken - begin;
    }
    return std::numeric_limits<double>::infinity();
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
  for (const double reading : {0.0, 0.001, 0.015, 0.022, 0.03, 0.038}) {  // seconds an image
    lateness = {};
    for (double held_up = 2; held_up > 0; held_up -= kInterval - reading) {
      taken += kInterval;
      lateness.Of(absl::Seconds(taken), absl::Seconds(taken + held_up));
      EXPECT_FALSE(lateness.settled()) << reading << ": " << held_up;
    }
    const double read = taken;
    while (!lateness.settled() && taken < read + 10) {
      taken += kInterval;
      EXPECT_EQ(lateness.Of(absl::Seconds(taken), absl::Seconds(taken)), absl::ZeroDuration());
    }
    EXPECT_LE(taken - read, 1.2) << reading;
  }
}

TEST_F(LatenessTest, OrdinaryStreamIsBelievedAfterAboutASecondAndStaysSo) {
  for (int i = 0; i < 100; ++i) {
    lateness = {};
    EXPECT_LE(TimeToSettle(), 2.0);
  }
  for (int i = 0; i < 10000; ++i) {
    Next();
    EXPECT_TRUE(lateness.settled());
  }
}

TEST_F(LatenessTest, StreamThatWasOnceQuickIsStillBelieved) {
  TimeToSettle();
  std::normal_distribution<double> jitter(0, 0.015);
  for (int i = 0; i < 100'000; ++i) {
    Next(i % 100 == 0 ? -0.05 : jitter(random));
    EXPECT_TRUE(lateness.settled()) << i;
  }
}

TEST_F(LatenessTest, StreamWhoseTimesJumpIsNotBelievedForASecond) {
  Begin();
  taken += 5;  // the camera's clock was set, or images were left out of what had piled up
  Next(-5);
  EXPECT_FALSE(lateness.settled());
}

TEST_F(LatenessTest, ClocksMayRunApart) {
  for (const double drift : {5e-4, -5e-4}) {
    lateness = {};
    taken = 0;
    TimeToSettle();
    for (int i = 0; i < 100000; ++i) {
      EXPECT_LE(Next(drift * taken), kJitter);
      EXPECT_TRUE(lateness.settled());
    }
  }
}

}  // namespace
}  // namespace silhouette
