// SPDX-License-Identifier: Apache-2.0
// What is known of the server's clock: never that something is younger than it is.
#include "clients/cpp/server_clock.h"
#include "tests/random.h"

#include <gtest/gtest.h>

#include <random>

namespace silhouette::client {
namespace {

using Time = ServerTime::Time;

// `seconds` after some moment, by this computer's clock.
Time At(double seconds) {
  return Time(std::chrono::hours(1000)) +
         std::chrono::nanoseconds(static_cast<int64_t>(seconds * 1e9));
}

double Seconds(Time time) { return std::chrono::duration<double>(time - At(0)).count(); }

TEST(ServerTime, WithoutARoundTripNothingIsKnown) {
  ServerTime time;
  EXPECT_FALSE(time.Earliest(absl::Seconds(5), At(0)));
}

TEST(ServerTime, IsThatOfTheQuestionAtTheEarliest) {
  ServerTime time;
  time.Observe(At(10), At(10.5), absl::Seconds(700));
  // Made just then, and received much later.
  EXPECT_NEAR(Seconds(*time.Earliest(absl::Seconds(700), At(100))), 10, 1e-6);
  // A second later: a thousandth of it for drift.
  EXPECT_NEAR(Seconds(*time.Earliest(absl::Seconds(701), At(100))), 10.999, 1e-6);
  // Before the round trip.
  EXPECT_NEAR(Seconds(*time.Earliest(absl::Seconds(600), At(100))), -90.1, 1e-6);
}

TEST(ServerTime, IsNeverLaterThanTheTruthThoughClocksDrift) {
  Random random;
  const auto uniform = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int run = 0; run < 200; ++run) {
    const double rate = 1 + uniform(-0.9e-3, 0.9e-3);
    const double begin = uniform(-1e5, 1e5);
    const auto server = [&](double now) { return absl::Seconds(begin + rate * now); };
    ServerTime time;
    double now = 0;
    double loosest = 0;
    for (int step = 0; step < 100; ++step) {
      now += uniform(0, 3);
      if (step % 3 == 0) {
        const double there = uniform(0, step % 2 == 0 ? 1e-3 : 0.4);
        const double answered = now + there + uniform(0, 0.3);
        time.Observe(At(now), At(answered), server(now + there));
        now = answered;
      }
      const double made = now - uniform(0, 5);  // it waited on its way
      const auto earliest = time.Earliest(server(made), At(now));
      ASSERT_TRUE(earliest);
      ASSERT_LE(Seconds(*earliest), made + 1e-6) << "run " << run << ", step " << step;
      loosest = std::max(loosest, made - Seconds(*earliest));
    }
    EXPECT_LT(loosest, 0.5) << "a bound that tells nothing";
  }
}

TEST(ServerTime, KeepsAQuickRoundTripWhileSlowOnesFollow) {
  ServerTime time;
  time.Observe(At(0), At(0.001), absl::Seconds(100));
  for (int i = 1; i <= 10; ++i) time.Observe(At(i), At(i + 0.9), absl::Seconds(100.8 + i));
  EXPECT_NEAR(Seconds(*time.Earliest(absl::Seconds(111), At(12))), 11 - 0.011, 1e-3);
}

TEST(ServerTime, OldRoundTripIsReplacedWhenDriftCouldBeMore) {
  ServerTime time;
  time.Observe(At(0), At(0.001), absl::Seconds(100));
  time.Observe(At(2000), At(2000.2), absl::Seconds(2100.1));
  EXPECT_NEAR(Seconds(*time.Earliest(absl::Seconds(2100.1), At(2001))), 2000, 1e-3);
}

TEST(ServerTime, ThatWasMadeAfterItWasReceivedForgetsAllRoundTrips) {
  ServerTime time;
  time.Observe(At(0), At(0.001), absl::Seconds(100));
  EXPECT_FALSE(time.Earliest(absl::Seconds(105), At(4))) << "the server's clock jumped ahead";
  EXPECT_FALSE(time.Earliest(absl::Seconds(100), At(4)));
  time.Observe(At(5), At(5.001), absl::Seconds(300));
  EXPECT_NEAR(Seconds(*time.Earliest(absl::Seconds(300), At(6))), 5, 1e-6);
}

TEST(ServerTime, RoundTripThatContradictsTakesThePlaceOfAll) {
  ServerTime time;
  time.Observe(At(0), At(0.001), absl::Seconds(100));
  time.Observe(At(1), At(1.001), absl::Seconds(4000));  // as after a sleep of this computer
  EXPECT_NEAR(Seconds(*time.Earliest(absl::Seconds(4000), At(2))), 1, 1e-6);
}

TEST(ServerTime, ClockAtIsNeverMoreThanTheClockShowed) {
  Random random;
  const auto uniform = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int run = 0; run < 200; ++run) {
    const double rate = 1 + uniform(-0.9e-3, 0.9e-3);
    double begin = uniform(-1e5, 1e5);
    const auto server = [&](double now) { return absl::Seconds(begin + rate * now); };
    ServerTime time;
    double now = 0;
    double loosest = 0;
    absl::Duration before = -absl::InfiniteDuration();
    EXPECT_FALSE(time.ClockAt(At(0)));
    for (int step = 0; step < 100; ++step) {
      now += uniform(0, 3);
      if (step % 3 == 0) {
        if (step == 51) begin = -1e6;  // the server's computer was restarted
        const double there = uniform(0, step % 2 == 0 ? 1e-3 : 0.4);
        const double answered = now + there + uniform(0, step % 2 == 0 ? 1e-3 : 0.4);
        time.Observe(At(now), At(answered), server(now + there));
        now = answered;
        if (step == 51) before = -absl::InfiniteDuration();
      }
      const double taken = now;
      const absl::Duration clock = *time.ClockAt(At(taken));
      ASSERT_LE(clock, server(taken) + absl::Microseconds(1)) << "run " << run << ", step " << step;
      EXPECT_GE(clock, before - absl::Microseconds(10)) << "stamps are in order";
      before = clock;
      loosest = std::max(loosest, absl::ToDoubleSeconds(server(taken) - clock));
    }
    EXPECT_LT(loosest, 0.9) << "a bound that tells nothing";
  }
}

TEST(ServerTime, ClockAtIsThatOfTheAnswerLessTheDrift) {
  ServerTime time;
  time.Observe(At(10), At(10.5), absl::Seconds(700));
  EXPECT_NEAR(absl::ToDoubleSeconds(*time.ClockAt(At(10.5))), 700, 1e-6);
  EXPECT_NEAR(absl::ToDoubleSeconds(*time.ClockAt(At(12.5))), 701.998, 1e-6);
  EXPECT_NEAR(absl::ToDoubleSeconds(*time.ClockAt(At(8.5))), 697.998, 1e-6);
}

TEST(ServerTime, BeyondAllMeasureIsVeryOld) {
  ServerTime time;
  time.Observe(At(0), At(0.001), absl::Seconds(100));
  for (const absl::Duration clock : {-absl::InfiniteDuration(), absl::Seconds(-4e18)}) {
    EXPECT_LT(Seconds(*time.Earliest(clock, At(1))), -1e9);
  }
  EXPECT_FALSE(time.Earliest(absl::InfiniteDuration(), At(1)));
}

}  // namespace
}  // namespace silhouette::client
