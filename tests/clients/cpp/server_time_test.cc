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

// A server whose clock drifts from the local one, and round trips to it.
struct DriftingServer {
  Random& random;
  double rate = 1 + Uniform(-0.9e-3, 0.9e-3);
  double begin = Uniform(-1e5, 1e5);
  double now = 0;  // local
  ServerTime time = {};

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  absl::Duration Clock(double at) const { return absl::Seconds(begin + rate * at); }
  void RoundTrip(double longest) {
    const double there = Uniform(0, longest);
    const double answered = now + there + Uniform(0, longest);
    time.Observe(At(now), At(answered), Clock(now + there));
    now = answered;
  }
};

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
  for (int run = 0; run < 200; ++run) {
    DriftingServer server{random};
    double loosest = 0;
    for (int step = 0; step < 100; ++step) {
      server.now += server.Uniform(0, 3);
      if (step % 3 == 0) server.RoundTrip(step % 2 == 0 ? 1e-3 : 0.4);
      const double made = server.now - server.Uniform(0, 5);  // it waited on its way
      const auto earliest = server.time.Earliest(server.Clock(made), At(server.now));
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
  for (int run = 0; run < 200; ++run) {
    DriftingServer server{random};
    double loosest = 0;
    absl::Duration before = -absl::InfiniteDuration();
    EXPECT_FALSE(server.time.ClockAt(At(0)));
    for (int step = 0; step < 100; ++step) {
      server.now += server.Uniform(0, 3);
      if (step == 51) {  // the server's computer was restarted
        server.begin = -1e6;
        before = -absl::InfiniteDuration();
      }
      if (step % 3 == 0) server.RoundTrip(step % 2 == 0 ? 1e-3 : 0.4);
      const absl::Duration clock = *server.time.ClockAt(At(server.now));
      const absl::Duration shown = server.Clock(server.now);
      ASSERT_LE(clock, shown + absl::Microseconds(1)) << "run " << run << ", step " << step;
      EXPECT_GE(clock, before - absl::Microseconds(10)) << "stamps are in order";
      before = clock;
      loosest = std::max(loosest, absl::ToDoubleSeconds(shown - clock));
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
