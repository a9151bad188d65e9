// SPDX-License-Identifier: Apache-2.0
// Watches and streams of the client library against the server itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <thread>
#include <vector>

#include "silhouette/client.h"
#include "silhouette/local_space.h"
#include "tests/random.h"
#include "tests/server/service/test_server.h"

namespace silhouette::client {
namespace {

constexpr absl::Duration kServedWatchesLong = absl::Seconds(20);

// A server whose clock runs.
struct RunningServer {
  explicit RunningServer(absl::Duration max_age = absl::Minutes(10), const TestDatabase& test = {})
      : server(NewDatabase(test), Settings(max_age),
               [](const silhouette::Clock&) { return SystemClock; }) {}

  static ServingSettings Settings(absl::Duration max_age) {
    ServingSettings settings;
    settings.scene.max_age = max_age;
    return settings;
  }
  Client client() const { return Client::Connect(server.server->address()).value(); }

  TestServer server;
};

// Waits until the map speaks of a scene.
bool Follows(const LocalSpace& space, uint64_t scene) {
  for (int i = 0; i < 4000; ++i) {
    if (space.basis().scene_id == scene) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

TEST(ServedLocalSpace, SaysWhatTheServerSaysOrUnknown) {
  Random random;
  RunningServer running(absl::Minutes(10), {.missing = {{2, 3}}, .index = random() % 2 == 0});
  int free_between = 0;
  int undecided = 0;
  const Client client = running.client();
  for (const Policy& policy :
       {Policy{}, Policy{.preset = "paper"}, Policy{.preset = "uncalibrated", .min_views = 1},
        Policy{.off_grid = OffGrid::kNearest}}) {
    const LocalSpace space(client, {.policy = policy, .max_age = absl::Minutes(5)});
    for (int round = 0; round < 3; ++round) {
      const uint64_t scene = running.server
                                 .Publish(SceneWithBlock(static_cast<int>(random() % 5),
                                                         1 + static_cast<int>(random() % 3)))
                                 .id();
      const bool nearest = policy.off_grid.has_value();
      ASSERT_TRUE(Follows(space, scene)) << space.status().problem;
      const auto snapshot = space.Snapshot();
      std::vector<Configuration> places;
      for (int a = 0; a < 5; ++a) {
        for (int b = 0; b < 8; ++b) places.push_back(At(a, b));
      }
      const size_t on_grid = places.size();
      for (int i = 0; i < 300; ++i) {
        const double a = std::uniform_real_distribution<double>(-0.2, 4.2)(random);
        places.push_back({i % 4 == 0 ? std::floor(a) : a,
                          std::uniform_real_distribution<double>(-4, 4)(random)});
      }
      const auto server = client.CheckConfigurations(places, policy);
      ASSERT_TRUE(server.ok()) << server.status();
      ASSERT_EQ(server->basis.scene_id, scene);
      for (size_t i = 0; i < places.size(); ++i) {
        const Verdict here = snapshot->Check(places[i]);
        const double a = places[i][0];
        if (here.reason == Reason::kBetweenGridPoints) {
          // Decided, but on a grid value along a joint.
          EXPECT_TRUE(i >= on_grid && !nearest && a == std::floor(a)) << a << ", " << places[i][1];
          ++undecided;
          continue;
        }
        if (i >= on_grid && !nearest && here.free()) ++free_between;
        ASSERT_EQ(here.state, server->verdicts[i].state)
            << places[i][0] << ", " << places[i][1] << ": " << Describe(here.reason);
      }
    }
  }
  EXPECT_GT(free_between, 100);
  EXPECT_LT(undecided, free_between);
}

TEST(ServedLocalSpace, MotionIsWhatTheServersPathIs) {
  Random random;
  RunningServer running(absl::Minutes(10), {.missing = {{2, 3}}});
  const Client client = running.client();
  const LocalSpace space(client, {.max_age = absl::Minutes(5)});
  ASSERT_TRUE(Follows(space, running.server.Publish(SceneWithBlock(2, 2)).id()));
  const auto value = [&](double lower, double upper) {
    return std::uniform_real_distribution<double>(lower, upper)(random);
  };
  int free = 0;
  int undecided = 0;
  for (int i = 0; i < 200; ++i) {
    const Configuration from{std::round(value(-0.2, 4.2) * 4) / 4, value(-4, 4)};
    const Configuration to{i % 3 == 0 ? from[0] : value(-0.2, 4.2), value(-4, 4)};
    const auto there = client.CheckPath(std::vector{from, to});
    ASSERT_TRUE(there.ok()) << there.status();
    const MotionVerdict here = space.CheckMotion(from, to);
    const MotionVerdict asked = space.CheckMotionOrAsk(from, to);
    EXPECT_EQ(asked.state, there->verdict.state);
    if (here.reason == Reason::kBetweenGridPoints) {
      ++undecided;
    } else {
      EXPECT_EQ(here.state, there->verdict.state);
      EXPECT_EQ(here.fraction, there->segment + there->fraction);
      EXPECT_EQ(here.proof, here.free() ? PathProof::kGrid : PathProof::kNone);
    }
    free += here.free() ? 1 : 0;
  }
  EXPECT_GT(free, 10);
  EXPECT_LT(undecided, 60);
}

TEST(ServedLocalSpace, TurnsUnknownWithTheSceneAndNamesTheServersReason) {
  RunningServer running(absl::Milliseconds(300));
  const LocalSpace space(running.client(), {.max_age = absl::Minutes(1)});
  auto snapshot = space.WaitForUpdate(0, kServedWatchesLong);
  EXPECT_EQ(snapshot->unknown_reason(), Reason::kNoScene);
  running.server.Publish(EmptyCellScene());
  for (int i = 0; i < 100 && snapshot->unknown_reason() != Reason::kSceneStale; ++i) {
    snapshot = space.WaitForUpdate(snapshot->number(), kServedWatchesLong);
    if (snapshot->unknown_reason() == std::nullopt) {
      EXPECT_LT(snapshot->Age(), absl::Milliseconds(300));
    }
  }
  EXPECT_EQ(snapshot->unknown_reason(), Reason::kSceneStale);
  EXPECT_EQ(snapshot->Check({0.4, 0.1}).reason, Reason::kSceneStale) << "between grid points";
  EXPECT_GE(snapshot->Age(), absl::Milliseconds(300));
}

TEST(ServedLocalSpace, ServerThatStopsLeavesNothingKnown) {
  RunningServer running;
  running.server.Publish(EmptyCellScene());
  const LocalSpace space(running.client(), {.max_age = absl::Minutes(1)});
  ASSERT_TRUE(Follows(space, 1));
  EXPECT_TRUE(space.Check(At(0, 0)).free());
  EXPECT_TRUE(space.Check({0.4, 0.1}).free()) << "between grid points from the first update on";
  running.server.server.reset();
  for (int i = 0; i < 4000 && space.unknown_reason() != Reason::kConnectionLost; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(space.Check(At(0, 0)).reason, Reason::kConnectionLost);
  EXPECT_EQ(space.Check({0.4, 0.1}).reason, Reason::kConnectionLost);
}

TEST(ServedLocalSpace, PolicyThatCannotBeServedIsNamed) {
  RunningServer running;
  const LocalSpace space(running.client(), {.policy = {.preset = "calibrated"}});
  EXPECT_EQ(space.WaitForUpdate(0, kServedWatchesLong)->unknown_reason(), Reason::kNotCheckedHere);
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kFailedPrecondition);
}

TEST(ServedLocalSpace, WhatTheServerRefusesIsNoLostConnection) {
  RunningServer running;
  const LocalSpace other_variant(running.client().WithVariant("glove"));
  EXPECT_EQ(other_variant.WaitForUpdate(0, kServedWatchesLong)->unknown_reason(), Reason::kRefused);
  EXPECT_THAT(std::string(other_variant.status().problem.message()), ::testing::HasSubstr("glove"));
  const LocalSpace no_tile(running.client(), {.tiles = {1'000'000}});
  EXPECT_EQ(no_tile.WaitForUpdate(0, kServedWatchesLong)->unknown_reason(), Reason::kRefused);
}

TEST(ServedPathWatch, FollowsTheScenes) {
  RunningServer running(absl::Minutes(10), {.index = true});
  const std::vector<Configuration> path = {At(0, 4), At(4, 4)};
  running.server.Publish(EmptyCellScene());
  PathWatch watch = running.client().WatchPath(path).value();
  auto update = watch.Next(kServedWatchesLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->FreeNow());
  running.server.Publish(SceneWithBlock(3));
  update = watch.Next(kServedWatchesLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_EQ(update->check.basis.scene_id, 2u);
  EXPECT_EQ(update->check.verdict.state, State::kOccupied);
  running.server.server->Stop(absl::Seconds(5));
  EXPECT_EQ(watch.Next(kServedWatchesLong).status().code(), absl::StatusCode::kUnavailable);
}

TEST(ServedCheckStream, AnswersAsSingleCallsDo) {
  RunningServer running(absl::Minutes(10), {.index = true});
  running.server.Publish(SceneWithBlock(3));
  const Client client = running.client();
  CheckStream stream = client.StreamChecks();
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      ASSERT_TRUE(stream.Send(static_cast<uint64_t>(a * 8 + b), {At(a, b)}).ok());
    }
  }
  ASSERT_TRUE(stream.Send(100, {{1.0}}).ok());  // a joint is missing
  const std::vector<Configuration> path = {At(0, 4), At(4, 4)};
  ASSERT_TRUE(stream.SendPath(101, path).ok());
  stream.EndQuestions();
  for (uint64_t id = 0; id < 40; ++id) {
    const auto answer = stream.Receive();
    ASSERT_TRUE(answer.ok()) << answer.status();
    ASSERT_EQ(answer->id, id);
    const Configuration q = At(static_cast<int>(id) / 8, static_cast<int>(id) % 8);
    const auto single = client.CheckConfigurations({q});
    ASSERT_TRUE(single.ok() && answer->checks.ok());
    EXPECT_EQ(answer->checks->verdicts[0].state, single->verdicts[0].state);
  }
  EXPECT_EQ(stream.Receive()->checks.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(stream.Receive()->path->verdict.state, State::kOccupied);
  EXPECT_EQ(stream.Receive().status().code(), absl::StatusCode::kOutOfRange);
}

}  // namespace
}  // namespace silhouette::client
