// SPDX-License-Identifier: Apache-2.0
// WatchConfigurationSpace and WatchPath, as a caller sees them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "server/service/answers.h"
#include "server/service/messages.h"
#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr auto kStale = v1::Verdict::REASON_SCENE_STALE;
constexpr auto kNoReason = v1::Verdict::REASON_UNSPECIFIED;

class WatchServiceTest : public ::testing::Test {
 protected:
  // What GetConfigurationSpace says now.
  std::map<uint64_t, std::string> FreeNow() {
    std::map<uint64_t, std::string> free;
    for (const auto& message : server.Space()) {
      for (const auto& tile : message.tiles()) free[tile.tile()] = tile.free();
    }
    return free;
  }

  TestServer server{NewDatabase({.index = true})};
};

TEST_F(WatchServiceTest, FirstUpdateIsTheWholeSpace) {
  server.Publish(SceneWithBlock(3));
  SpaceWatching watching(server);
  const SpaceUpdate update = watching.Next();
  EXPECT_TRUE(update.first.whole());
  EXPECT_EQ(update.first.grid().joints_size(), 2);
  EXPECT_EQ(update.first.basis().scene_id(), 1u);
  EXPECT_EQ(update.first.unknown_reason(), kNoReason);
  EXPECT_EQ(update.first.basis().valid_for().seconds(), 1);
  EXPECT_EQ(update.first.skipped_scenes(), 0u);
  EXPECT_EQ(watching.free(), FreeNow());
}

TEST_F(WatchServiceTest, UpdateIsValidUntilItsSceneIsTooOld) {
  server.Publish(EmptyCellScene());
  server.clock.Advance(absl::Milliseconds(400));
  EXPECT_EQ(SpaceWatching(server).Next().first.basis().valid_for().nanos(), 600'000'000);
  EXPECT_EQ(PathWatching(server, {At(0, 0)}).Next().check().basis().valid_for().nanos(),
            600'000'000);
}

TEST_F(WatchServiceTest, EverySceneIsTold) {
  server.Publish(EmptyCellScene());
  SpaceWatching watching(server);
  watching.Next();
  for (uint64_t scene = 2; scene < 12; ++scene) {
    server.Publish(SceneWithBlock(static_cast<int>(scene % 5)));
    const SpaceUpdate update = watching.Next();
    EXPECT_EQ(update.first.basis().scene_id(), scene);
    EXPECT_FALSE(update.first.whole());
    EXPECT_FALSE(update.first.has_grid());
    EXPECT_EQ(update.first.skipped_scenes(), 0u);
    EXPECT_EQ(watching.free(), FreeNow());
  }
}

TEST_F(WatchServiceTest, WhatDidNotChangeIsNotSentAgain) {
  server.Publish(SceneWithBlock(3));
  SpaceWatching watching(server);
  EXPECT_EQ(watching.Next().tiles, 1u);
  server.Publish(SceneWithBlock(3));
  const SpaceUpdate same = watching.Next();
  EXPECT_EQ(same.first.basis().scene_id(), 2u);
  EXPECT_EQ(same.tiles, 0u);
}

TEST_F(WatchServiceTest, WithoutSceneAllIsUnknownUntilThereIsOne) {
  SpaceWatching watching(server);
  const SpaceUpdate none = watching.Next();
  EXPECT_EQ(none.first.unknown_reason(), v1::Verdict::REASON_NO_SCENE);
  EXPECT_EQ(none.first.basis().valid_for().seconds(), 0);
  EXPECT_EQ(none.tiles, 0u);
  server.Publish(SceneWithBlock(3));
  const SpaceUpdate update = watching.Next();
  EXPECT_EQ(update.first.unknown_reason(), kNoReason);
  EXPECT_EQ(watching.free(), FreeNow());
}

TEST_F(WatchServiceTest, SceneThatBecomesTooOldIsTold) {
  server.Publish(SceneWithBlock(3));
  SpaceWatching watching(server);
  watching.Next();
  server.clock.Advance(absl::Seconds(2));
  const SpaceUpdate stale = watching.Next();
  EXPECT_EQ(stale.first.unknown_reason(), kStale);
  EXPECT_EQ(stale.tiles, 0u);
  server.Publish(SceneWithBlock(3));
  const SpaceUpdate again = watching.Next();
  EXPECT_EQ(again.first.unknown_reason(), kNoReason);
  EXPECT_FALSE(again.first.whole());
  EXPECT_EQ(again.tiles, 0u) << "the caller has them still";
}

TEST_F(WatchServiceTest, SceneWithoutAViewIsNeverFree) {
  server.Publish(EmptyCellScene());
  SpaceWatching watching(server);
  watching.Next();
  SceneInput lacking = EmptyCellScene();
  lacking.views.pop_back();
  server.Publish(lacking);
  watching.Next();
  for (const auto& [tile, free] : watching.free()) {
    EXPECT_EQ(free, std::string(kTileSize / 8, '\0'));
  }
}

TEST_F(WatchServiceTest, AllowedRegionIsToldWhenItBeginsAndWhenItEnds) {
  server.Publish(SceneWithBlock(3));
  SpaceWatching watching(server);
  watching.Next();
  const auto with_block = watching.free();
  server.Allow("part", 3, absl::Milliseconds(300));
  const SpaceUpdate allowed = watching.Next();
  EXPECT_THAT(allowed.first.basis().regions(), ElementsAre("part"));
  EXPECT_LE(allowed.first.basis().valid_for().nanos(), 300'000'000);
  EXPECT_EQ(allowed.first.basis().valid_for().seconds(), 0);
  EXPECT_NE(watching.free(), with_block);
  server.clock.Advance(absl::Milliseconds(300));
  const SpaceUpdate ended = watching.Next();
  EXPECT_THAT(ended.first.basis().regions(), IsEmpty());
  EXPECT_EQ(watching.free(), with_block);
}

TEST_F(WatchServiceTest, AnotherDatabaseIsToldWhole) {
  server.Publish(SceneWithBlock(3));
  SpaceWatching watching(server);
  watching.Next();
  server.server->ReplaceDatabase(NewDatabase({.missing = {{1, 1}}}));
  const SpaceUpdate replaced = watching.Next();
  EXPECT_TRUE(replaced.first.whole());
  EXPECT_TRUE(replaced.first.has_grid());
  EXPECT_EQ(replaced.first.unknown_reason(), v1::Verdict::REASON_GENERATION_MISMATCH);
  server.Publish(SceneWithBlock(3));
  watching.Next();
  EXPECT_EQ(watching.free(), FreeNow());
}

TEST_F(WatchServiceTest, TileThatTheGridDoesNotHaveEndsTheCall) {
  server.Publish(SceneWithBlock(3));
  v1::WatchConfigurationSpaceRequest request;
  request.add_tiles(7);
  SpaceWatching watching(server, request);
  EXPECT_THAT(watching.Finish().error_message(), HasSubstr("there is no tile 7"));
}

TEST_F(WatchServiceTest, PolicyThatCannotBeServedEndsTheCall) {
  v1::WatchConfigurationSpaceRequest request;
  request.mutable_policy()->set_preset("calibrated");
  SpaceWatching watching(server, request);
  EXPECT_EQ(watching.Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(WatchServiceTest, ServerThatStopsSaysSo) {
  SpaceWatching space(server);
  space.Next();
  PathWatching path(server, {At(0, 0), At(4, 0)});
  path.Next();
  server.server->Stop(absl::Seconds(100));
  EXPECT_EQ(space.Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(path.Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(WatchServiceTest, CallerWhoGoesAwayIsForgotten) {
  server.Publish(SceneWithBlock(3));
  for (int i = 0; i < 20; ++i) {
    SpaceWatching watching(server);
    if (i % 2 == 0) watching.Next();
    watching.Cancel();
    EXPECT_EQ(watching.Finish().error_code(), grpc::StatusCode::CANCELLED);
  }
  server.server->Stop(absl::InfiniteDuration());  // waits for all calls
}

TEST_F(WatchServiceTest, PathIsJudgedAnewWithEveryScene) {
  server.Publish(SceneWithBlock(3));
  PathWatching watching(server, {At(0, 0), At(4, 0)});
  const v1::WatchPathResponse occupied = watching.Next();
  EXPECT_EQ(occupied.check().verdict().state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(occupied.check().SerializeAsString(),
            server.Path({At(0, 0), At(4, 0)}).SerializeAsString());
  server.Publish(EmptyCellScene());
  const v1::WatchPathResponse free = watching.Next();
  EXPECT_EQ(free.check().verdict().state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(free.check().basis().scene_id(), 2u);
  EXPECT_EQ(free.check().basis().valid_for().seconds(), 1);
  server.clock.Advance(absl::Seconds(2));
  const v1::WatchPathResponse stale = watching.Next();
  EXPECT_EQ(stale.check().verdict().state(), v1::Verdict::STATE_UNKNOWN);
  EXPECT_EQ(stale.check().verdict().reason(), kStale);
  EXPECT_EQ(stale.check().basis().valid_for().seconds() + stale.check().basis().valid_for().nanos(),
            0);
}

TEST_F(WatchServiceTest, PathWithoutWaypointsEndsTheCall) {
  PathWatching watching(server, {});
  const grpc::Status status = watching.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(), "waypoints: a path has at least one");
}

// A server's state with a scene, while an answer is made.
struct ConcludeTest : testing::Test {
  ConcludeTest() {
    absl::StatusOr<Scene> scene = MakeScene(*database, SceneWithBlock(3), {}, {}, clock.clock()());
    EXPECT_TRUE(serving.scenes.Publish(*std::move(scene), database).ok());
  }

  ServingSettings Settings() {
    ServingSettings settings;
    settings.clock = clock.clock();
    return settings;
  }

  // The only one.
  static void ExpectDefect(const v1::Basis& basis, v1::Verdict::Reason reason,
                           const std::string& message) {
    ASSERT_EQ(basis.defects_size(), 1);
    EXPECT_EQ(basis.defects(0).reason(), reason);
    EXPECT_THAT(basis.defects(0).message(), HasSubstr(message));
  }

  const std::shared_ptr<const ServedDatabase> database = NewDatabase();
  TestClock clock;
  Serving serving{database, Settings()};
};

TEST_F(ConcludeTest, DatabaseReplacedWhileAnAnswerIsMadeTakesItBack) {
  const Served served = serving.scenes.Newest(clock.clock()());
  v1::Basis basis;
  EXPECT_EQ(Conclude(serving, served, {}, &basis), Reason::kNone);
  serving.scenes.ReplaceDatabase(NewDatabase());
  EXPECT_EQ(Conclude(serving, served, {}, &basis), Reason::kGenerationMismatch);
  EXPECT_EQ(DurationFrom(basis.valid_for()), absl::ZeroDuration());
  ExpectDefect(basis, v1::Verdict::REASON_GENERATION_MISMATCH, "the database was replaced");
}

TEST_F(ConcludeTest, RegionRevokedWhileAnAnswerIsMadeTakesItBack) {
  std::vector<std::optional<Mask>> pixels;
  for (int view = 0; view < 3; ++view) pixels.emplace_back(Block(view, 3));
  const Moment now = clock.clock()();
  ASSERT_TRUE(serving.scenes.Allow("part", pixels, absl::Milliseconds(500), now, database).ok());
  const Served served = serving.scenes.Newest(now);
  v1::Basis basis;
  EXPECT_EQ(Conclude(serving, served, {}, &basis), Reason::kNone);
  EXPECT_EQ(DurationFrom(basis.valid_for()), absl::Milliseconds(500));
  ASSERT_TRUE(serving.scenes.Revoke("part", now));
  EXPECT_EQ(Conclude(serving, served, {}, &basis), Reason::kRegionEnded);
  EXPECT_EQ(DurationFrom(basis.valid_for()), absl::ZeroDuration());
  ExpectDefect(basis, v1::Verdict::REASON_REGION_ENDED, "revoked");
}

TEST_F(ConcludeTest, VariantThatChangesWhileAnAnswerIsMadeTakesItBack) {
  const Served served = serving.scenes.Newest(clock.clock()());
  serving.scenes.Withdraw("the robot's variant is changing", clock.clock()());
  v1::Basis basis;
  EXPECT_EQ(Conclude(serving, served, {}, &basis), Reason::kVariantUnknown);
  ExpectDefect(basis, v1::Verdict::REASON_VARIANT_UNKNOWN, "variant changed");
  // A scene that shows it says so itself.
  v1::Basis of_next;
  EXPECT_EQ(Conclude(serving, serving.scenes.Newest(clock.clock()()), {}, &of_next),
            Reason::kVariantUnknown);
  ExpectDefect(of_next, v1::Verdict::REASON_VARIANT_UNKNOWN, "is changing");
}

}  // namespace
}  // namespace silhouette
