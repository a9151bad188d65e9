// SPDX-License-Identifier: Apache-2.0
// The map in the client: what the server last said, and never longer than that can be relied on.
#include "silhouette/local_space.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <thread>

#include "tests/clients/cpp/watched_space.h"
#include "tests/shell.h"

namespace silhouette::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr absl::Duration kLocalSpaceLong = absl::Seconds(20);
// Places in tiles that FirstUpdate calls free and occupied, and in the one that it does not send.
constexpr ConfigurationNumber kFreePlace = 5;
constexpr ConfigurationNumber kOccupiedPlace = kTileSize + 5;
constexpr ConfigurationNumber kNotSent = 3 * kTileSize + 5;

Client LocalSpaceClientOf(const WatchedServer& server) { return ClientOfHere(server.fake); }

// Waits until all is unknown for `reason`; whether that came.
bool TurnsUnknown(const LocalSpace& space, Reason reason) {
  for (int i = 0; i < 2000; ++i) {
    if (space.unknown_reason() == reason) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

// Nothing is free, for this reason.
void ExpectUnknown(const LocalSpace& space, Reason reason) {
  EXPECT_EQ(space.unknown_reason(), reason);
  EXPECT_EQ(space.StateAt(kFreePlace), State::kUnknown);
  EXPECT_EQ(space.StateAt(kOccupiedPlace), State::kUnknown);
  const Verdict verdict = space.Check({0, 5});
  EXPECT_EQ(verdict.state, State::kUnknown);
  EXPECT_EQ(verdict.reason, reason);
  EXPECT_EQ(space.Snapshot()->Count().free, 0u);
  const NumberChecks numbers = space.CheckNumbers(std::vector{uint32_t{kFreePlace}});
  EXPECT_EQ(numbers.StateOf(0), State::kUnknown);
  EXPECT_EQ(numbers.unknown_reason, reason);
  const std::vector<Configuration> q = {{0, 5}, {0, 6}};
  for (const Verdict& each : space.CheckConfigurations(q).verdicts) {
    EXPECT_EQ(each.state, State::kUnknown);
    EXPECT_EQ(each.reason, reason);
  }
}

TEST(LocalSpace, BeforeTheFirstUpdateEverythingIsUnknown) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server));
  ASSERT_TRUE(server.WaitForStreams(1));
  ExpectUnknown(space, Reason::kNoUpdate);
  EXPECT_EQ(space.Snapshot()->grid(), nullptr);
  EXPECT_EQ(space.Snapshot()->basis().Age(), absl::InfiniteDuration());
  SpacePart part = FirstUpdate(BasisOf(3));
  part.set_last_part(false);
  server.Send(part);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  ExpectUnknown(space, Reason::kNoUpdate);
}

TEST(LocalSpace, AnswersAsTheServerDid) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server),
                         {.policy = {.preset = "paper"}, .tiles = {0, 1, 2}});
  v1::Basis basis = BasisOf(3, absl::Milliseconds(20));
  basis.add_regions("part");
  server.Send(FirstUpdate(basis));
  const auto snapshot = space.WaitForUpdate(0, kLocalSpaceLong);
  EXPECT_EQ(snapshot->number(), 1u);
  EXPECT_EQ(snapshot->unknown_reason(), std::nullopt);
  EXPECT_EQ(snapshot->basis().scene_id, 3u);
  EXPECT_GE(snapshot->basis().Age(), absl::Milliseconds(20));
  EXPECT_EQ(*snapshot->grid(), WatchedGrid());
  EXPECT_TRUE(space.IsFree(kFreePlace));
  EXPECT_EQ(space.StateAt(kOccupiedPlace), State::kOccupied);
  EXPECT_EQ(space.StateAt(kNotSent), State::kUnknown);
  EXPECT_EQ(space.StateAt(~uint64_t{0}), State::kUnknown);
  const NumberChecks numbers = space.CheckNumbers(
      std::vector{uint32_t{kFreePlace}, uint32_t{kOccupiedPlace}, uint32_t{kNotSent}});
  EXPECT_EQ(numbers.basis.scene_id, 3u);
  EXPECT_EQ(numbers.StateOf(0), State::kFree);
  EXPECT_EQ(numbers.StateOf(1), State::kOccupied);
  EXPECT_EQ(numbers.StateOf(2), State::kUnknown);
  EXPECT_EQ(numbers.unknown_reason, Reason::kNotInMap);
  const ConfigurationChecks checks =
      space.CheckConfigurations(std::vector<Configuration>{{0, 5}, {0, 64}});
  EXPECT_EQ(checks.basis.scene_id, 3u);
  EXPECT_TRUE(checks.verdicts.at(0).free());
  EXPECT_EQ(checks.verdicts.at(1).state, State::kOccupied);
  const StateCounts counts = snapshot->Count();
  EXPECT_EQ(counts.free, kTileSize + 36 * 64);
  EXPECT_EQ(counts.occupied, 64u * 36);
  EXPECT_EQ(counts.free + counts.occupied + counts.unknown, 10'000u);
  Basis basis_of_check;
  const Verdict verdict = space.Check({0, 5}, &basis_of_check);
  EXPECT_TRUE(verdict.free());
  EXPECT_EQ(basis_of_check.scene_id, 3u);
  EXPECT_THAT(verdict.regions, ElementsAre("part"));
  EXPECT_EQ(space.Check({99, 99}).reason, Reason::kNotInMap);
  EXPECT_EQ(space.Check({99, 100}).reason, Reason::kOutsideGrid);
  EXPECT_EQ(space.Check({1}).reason, Reason::kOutsideGrid);
  EXPECT_EQ(server.asked().policy().preset(), "paper");
  EXPECT_THAT(server.asked().tiles(), ElementsAre(0, 1, 2));
  EXPECT_TRUE(space.status().connected);
  EXPECT_TRUE(space.status().problem.ok());
}

TEST(LocalSpace, FollowsEveryUpdateAndASnapshotStaysWhatItIs) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server));
  server.Send(FirstUpdate(BasisOf(3)));
  const auto first = space.WaitForUpdate(0, kLocalSpaceLong);
  SpacePart part = Update(BasisOf(8));
  AddTile(part, 0, false);
  part.set_skipped_scenes(4);
  server.Send(part);
  const auto second = space.WaitForUpdate(first->number(), kLocalSpaceLong);
  EXPECT_EQ(second->basis().scene_id, 8u);
  EXPECT_EQ(second->skipped_scenes(), 4u);
  EXPECT_EQ(second->tiles_changed(), 1u);
  EXPECT_EQ(space.StateAt(kFreePlace), State::kOccupied);
  EXPECT_EQ(first->StateAt(kFreePlace), State::kFree);
  EXPECT_EQ(first->basis().scene_id, 3u);
  EXPECT_EQ(space.status().updates, 2u);
  EXPECT_EQ(space.status().skipped_scenes, 4u);
  EXPECT_EQ(space.WaitForUpdate(second->number(), absl::Milliseconds(20)), second)
      << "nothing new came";
}

TEST(LocalSpace, StalledStreamTurnsUnknownAtMaxAge) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Milliseconds(400)});
  server.Send(FirstUpdate(BasisOf(3)));
  const auto snapshot = space.WaitForUpdate(0, kLocalSpaceLong);
  ASSERT_TRUE(TurnsUnknown(space, Reason::kUpdateTooOld));
  EXPECT_GE(snapshot->basis().Age(), absl::Milliseconds(400));
  ExpectUnknown(space, Reason::kUpdateTooOld);
  EXPECT_TRUE(space.status().connected);
  server.Send(Update(BasisOf(4)));
  EXPECT_EQ(space.WaitForUpdate(snapshot->number(), kLocalSpaceLong)->unknown_reason(),
            std::nullopt);
}

TEST(LocalSpace, AgeOfTheSceneWhenTheUpdateWasMadeCounts) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Seconds(30)});
  server.Send(FirstUpdate(BasisOf(3, absl::Seconds(31))));
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kUpdateTooOld);
  server.Send(Update(BasisOf(4, absl::Seconds(10))));
  space.WaitForUpdate(1, kLocalSpaceLong);
  EXPECT_TRUE(space.IsFree(kFreePlace));
}

TEST(LocalSpace, TurnsUnknownWhenTheServerNoLongerVouches) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Minutes(1)});
  SpacePart part = FirstUpdate(BasisOf(3));
  Set(absl::Milliseconds(400), part.mutable_basis()->mutable_valid_for());
  server.Send(part);
  space.WaitForUpdate(0, kLocalSpaceLong);
  ASSERT_TRUE(TurnsUnknown(space, Reason::kUpdateExpired));
  ExpectUnknown(space, Reason::kUpdateExpired);
}

TEST(LocalSpace, MessageThatWaitedOnItsWayIsAsOldAsItIs) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Seconds(10)});
  // Quite new when it was made; but that was long ago.
  server.Send(FirstUpdate(BasisOf(3, absl::Milliseconds(1), /*ago=*/absl::Seconds(11))));
  const auto snapshot = space.WaitForUpdate(0, kLocalSpaceLong);
  EXPECT_GE(snapshot->basis().Age(), absl::Seconds(11));
  EXPECT_LT(snapshot->basis().Age(), absl::Seconds(20)) << "a bound that tells nothing";
  ExpectUnknown(space, Reason::kUpdateTooOld);
  // Of what the server vouches for, the time on the way is gone, too.
  SpacePart part = Update(BasisOf(4, absl::Milliseconds(1), /*ago=*/absl::Seconds(5)));
  Set(absl::Seconds(4), part.mutable_basis()->mutable_valid_for());
  server.Send(part);
  space.WaitForUpdate(snapshot->number(), kLocalSpaceLong);
  ExpectUnknown(space, Reason::kUpdateExpired);
  server.Send(Update(BasisOf(5, absl::Milliseconds(1), /*ago=*/absl::Seconds(1))));
  space.WaitForUpdate(snapshot->number() + 1, kLocalSpaceLong);
  EXPECT_TRUE(space.IsFree(kFreePlace));
}

TEST(LocalSpace, WhatTheServerCallsUnknownIs) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server));
  SpacePart part = Update(BasisOf(3), /*whole=*/true);
  part.set_unknown_reason(v1::Verdict::REASON_VIEW_MISSING);
  server.Send(part);
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kViewMissing);
  EXPECT_EQ(space.Snapshot()->Count().unknown, 10'000u);
  part = Update(BasisOf(4));
  part.set_unknown_reason(static_cast<v1::Verdict::Reason>(77));
  server.Send(part);
  space.WaitForUpdate(1, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kUnspecified);
  server.Send(Update(BasisOf(0)));
  space.WaitForUpdate(2, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kNoScene);
}

TEST(LocalSpace, LostStreamIsUnknownAtOnceAndWatchedAgain) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Minutes(1)});
  server.Send(FirstUpdate(BasisOf(3)));
  const auto before = space.WaitForUpdate(0, kLocalSpaceLong);
  EXPECT_TRUE(space.IsFree(kFreePlace));
  server.End(grpc::Status(grpc::StatusCode::UNAVAILABLE, "the server stops"));
  const auto lost = space.WaitForUpdate(before->number(), kLocalSpaceLong);
  EXPECT_EQ(lost->unknown_reason(), Reason::kConnectionLost);
  ExpectUnknown(space, Reason::kConnectionLost);
  ASSERT_TRUE(server.WaitForStreams(2));
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kUnavailable);
  EXPECT_FALSE(space.status().connected);
  EXPECT_EQ(space.status().attempts, 2u);
  server.Send(FirstUpdate(BasisOf(1)));
  space.WaitForUpdate(lost->number(), kLocalSpaceLong);
  EXPECT_TRUE(space.IsFree(kFreePlace));
  EXPECT_TRUE(space.status().connected);
  EXPECT_TRUE(space.status().problem.ok());
}

TEST(LocalSpace, StreamThatEndsInTheMiddleOfAnUpdateIsLost) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server));
  SpacePart part = FirstUpdate(BasisOf(3));
  part.set_last_part(false);
  server.Send(part);
  server.End(grpc::Status::OK);
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kConnectionLost);
  // Nor does the rest of it count on the next stream.
  ASSERT_TRUE(server.WaitForStreams(2));
  SpacePart rest;
  AddTile(rest, 3, true);
  rest.set_last_part(true);
  server.Send(rest);
  ASSERT_TRUE(TurnsUnknown(space, Reason::kUpdateMalformed));
  ExpectUnknown(space, Reason::kUpdateMalformed);
}

TEST(LocalSpace, ServerThatIsStartedAgainIsFoundAgain) {
  const Shell folder;
  const std::string address = "unix:" + (folder.folder() / "s").string();
  auto server = std::make_unique<WatchedServer>(address);
  const LocalSpace space(LocalSpaceClientOf(*server));
  server->Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  server.reset();
  ASSERT_TRUE(TurnsUnknown(space, Reason::kConnectionLost));
  EXPECT_THAT(std::string(space.status().problem.message()), HasSubstr(address));
  server = std::make_unique<WatchedServer>(address);
  server->Send(FirstUpdate(BasisOf(1)));
  const auto snapshot = space.WaitForUpdate(2, kLocalSpaceLong);
  EXPECT_EQ(snapshot->basis().scene_id, 1u);
}

TEST(LocalSpace, TimeoutThatIsNotPositiveIsRefusedAndNoLostConnection) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server).WithTimeout(absl::ZeroDuration()));
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kRefused);
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kInvalidArgument);
}

TEST(LocalSpace, MalformedUpdateIsUnknownAndWatchedAgain) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Minutes(1)});
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  SpacePart part = Update(BasisOf(4));
  AddTile(part, 0, true);
  AddTile(part, 0, true);
  server.Send(part);
  space.WaitForUpdate(1, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kUpdateMalformed);
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(space.status().problem.message()), HasSubstr("tile 0 comes twice"));
  ASSERT_TRUE(server.WaitForStreams(2));
  server.Send(FirstUpdate(BasisOf(5)));
  space.WaitForUpdate(2, kLocalSpaceLong);
  EXPECT_TRUE(space.IsFree(kFreePlace));
}

TEST(LocalSpace, ServerThatTellsNoClockIsTooOld) {
  WatchedServer server;
  server.fake.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    response.mutable_basis()->set_scene_id(1);
    response.mutable_basis()->mutable_valid_for()->set_seconds(60);
    return grpc::Status::OK;
  };
  const LocalSpace space(LocalSpaceClientOf(server));
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kAgeUnknown);
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kUnimplemented);
}

TEST(LocalSpace, UpdateThatTellsNoClockIsUnknown) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server));
  v1::Basis basis = BasisOf(3);
  basis.clear_server_clock();
  server.Send(FirstUpdate(basis));
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kAgeUnknown);
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kUnimplemented);
}

TEST(LocalSpace, UpdateFromTheFutureIsUnknown) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server));
  server.Send(FirstUpdate(BasisOf(3, absl::ZeroDuration(), /*ago=*/absl::Seconds(-5))));
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kAgeUnknown);
}

TEST(LocalSpace, ServerWhoseClockIsNotToldInTimeIsUnknown) {
  WatchedServer server;
  server.fake.check_configurations = [](grpc::ServerContext& context, auto&, auto&) {
    while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return grpc::Status::CANCELLED;
  };
  const LocalSpace space(LocalSpaceClientOf(server));
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kAgeUnknown);
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kUnavailable);
}

TEST(LocalSpace, ServerThatCannotBeWatchedIsNamed) {
  FakeServer server;
  const LocalSpace space(ClientOfHere(server));
  space.WaitForUpdate(0, kLocalSpaceLong);
  ExpectUnknown(space, Reason::kRefused);
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kUnimplemented);
}

TEST(LocalSpace, OffTheGridAnswersByTheServersRule) {
  WatchedServer server;
  server.fake.get_database = [](auto&, auto&, v1::GetDatabaseResponse& response) {
    response.set_generation(7);
    Set(WatchedGrid(), response.mutable_grid());
    response.add_views();
    response.mutable_default_policy()->set_preset("uncalibrated");
    response.mutable_default_policy()->set_min_views(1);
    response.mutable_default_policy()->set_off_grid(v1::OFF_GRID_CELL);
    return grpc::Status::OK;
  };
  const LocalSpace cell(LocalSpaceClientOf(server));
  server.Send(FirstUpdate(BasisOf(3)));
  cell.WaitForUpdate(0, kLocalSpaceLong);
  for (int i = 0; i < 1000 && !cell.Check({0.5, 5.5}).free(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // until it has asked for the rule
  }
  EXPECT_TRUE(cell.Check({0.5, 5.5}).free());
  EXPECT_EQ(cell.Check({0.5, 63.5}).state, State::kOccupied) << "a corner is";
  EXPECT_EQ(cell.Snapshot()->number(), 1u);
}

TEST(LocalSpace, OffTheGridAnotherDatabaseOfTheSameGenerationHasARuleOfItsOwn) {
  WatchedServer server;
  std::atomic<int> min_views = 1;
  std::atomic<int> asked = 0;
  server.fake.get_database = [&](auto&, auto&, v1::GetDatabaseResponse& response) {
    ++asked;
    response.set_generation(7);
    Set(WatchedGrid(), response.mutable_grid());
    response.add_views();
    response.add_views();
    response.mutable_default_policy()->set_preset("uncalibrated");
    response.mutable_default_policy()->set_min_views(min_views);
    response.mutable_default_policy()->set_off_grid(v1::OFF_GRID_CELL);
    return grpc::Status::OK;
  };
  const LocalSpace space(LocalSpaceClientOf(server));
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  for (int i = 0; i < 1000 && !space.Check({0.5, 5.5}).free(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // until it has asked for the rule
  }
  EXPECT_TRUE(space.Check({0.5, 5.5}).free());
  server.Send(Update(BasisOf(4)));
  space.WaitForUpdate(1, kLocalSpaceLong);
  EXPECT_TRUE(space.Check({0.5, 5.5}).free()) << "of the same database";
  min_views = 2;
  server.Send(FirstUpdate(BasisOf(5)));
  space.WaitForUpdate(2, kLocalSpaceLong);
  EXPECT_EQ(space.Check({0.5, 5.5}).reason, Reason::kBetweenGridPoints);
  for (int i = 0; i < 1000 && asked < 2; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(asked, 2);
  EXPECT_EQ(space.Check({0.5, 5.5}).reason, Reason::kBetweenGridPoints);
}

TEST(LocalSpace, OffTheGridNothingIsKnownWithoutTheServersRule) {
  WatchedServer server;  // that knows no GetDatabase
  const LocalSpace space(LocalSpaceClientOf(server));
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  EXPECT_TRUE(space.Check({0, 5}).free());
  EXPECT_EQ(space.Check({0.5, 5.5}).reason, Reason::kBetweenGridPoints);
  EXPECT_EQ(space.Check({0.5, 63.5}).reason, Reason::kBetweenGridPoints);
}

TEST(LocalSpace, MotionThatTheServerIsAskedForKeepsItsReasonAndIsNeverOlderThanMaxAge) {
  std::array<v1::CheckPathResponse, 3> answers;
  *answers[0].mutable_basis() = BasisOf(3);
  Set(absl::ZeroDuration(), answers[0].mutable_basis()->mutable_valid_for());
  answers[0].mutable_verdict()->set_state(v1::Verdict::STATE_UNKNOWN);
  answers[0].mutable_verdict()->set_reason(v1::Verdict::REASON_VIEW_MISSING);
  *answers[1].mutable_basis() = BasisOf(3, absl::Minutes(11));
  answers[1].mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
  *answers[2].mutable_basis() = BasisOf(3, absl::Seconds(1));
  answers[2].mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
  std::atomic<size_t> asked = 0;
  WatchedServer server;  // that knows no GetDatabase: between grid points it is asked
  server.fake.check_path = [&](auto&, auto&, v1::CheckPathResponse& response) {
    response = answers.at(asked++);
    return grpc::Status::OK;
  };
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Minutes(10)});
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  const Configuration from = {0.5, 5.5};
  const Configuration to = {0.5, 6.5};
  EXPECT_EQ(space.CheckMotionOrAsk(from, to).reason, Reason::kViewMissing);
  const MotionVerdict old = space.CheckMotionOrAsk(from, to);
  EXPECT_EQ(old.state, State::kUnknown);
  EXPECT_EQ(old.reason, Reason::kUpdateTooOld);
  EXPECT_TRUE(space.CheckMotionOrAsk(from, to).free());
}

TEST(LocalSpace, PathResolutionThatTheServerRefusesIsRefusedOfACapturedRobotToo) {
  WatchedServer server;
  const LocalSpace space(LocalSpaceClientOf(server));
  const Configuration q = {0, 5};
  EXPECT_THROW(space.CheckMotion(q, q, 0.2), std::invalid_argument) << "before an update, too";
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  for (const double resolution : {0.0, 0.0001, 0.2, std::nan("")}) {
    EXPECT_THROW(space.CheckMotion(q, q, resolution), std::invalid_argument);
    EXPECT_THROW(space.CheckMotionOrAsk(q, q, resolution), std::invalid_argument);
  }
  for (const double resolution : {0.0005, 0.1}) {
    EXPECT_NO_THROW(space.CheckMotion(q, q, resolution));
  }
}

TEST(LocalSpace, LimitOfTheServerIsARefusalAndNoLostConnection) {
  const grpc::Status limit(grpc::StatusCode::RESOURCE_EXHAUSTED, "beyond a limit");
  WatchedServer server;  // that knows no GetDatabase: between grid points it is asked
  server.fake.check_path = [&](auto&, auto&, auto&) { return limit; };
  const LocalSpace space(LocalSpaceClientOf(server), {.max_age = absl::Minutes(10)});
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kLocalSpaceLong);
  EXPECT_EQ(space.CheckMotionOrAsk(Configuration{0.5, 5.5}, Configuration{0.5, 6.5}).reason,
            Reason::kRefused);
  server.End(limit);
  EXPECT_TRUE(TurnsUnknown(space, Reason::kRefused));
  EXPECT_THAT(std::string(space.status().problem.message()), HasSubstr("beyond a limit"));
}

TEST(LocalSpace, EndsAtOnceWhateverItWaitsFor) {
  WatchedServer server;
  server.fake.check_configurations = [](grpc::ServerContext& context, auto&, auto&) {
    while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return grpc::Status::CANCELLED;
  };
  { const LocalSpace just_begun(LocalSpaceClientOf(server)); }
  {
    const LocalSpace waits_for_an_update(LocalSpaceClientOf(server));
    ASSERT_TRUE(server.WaitForStreams(1));
  }
  {
    const LocalSpace waits_for_the_clock(LocalSpaceClientOf(server));
    server.Send(FirstUpdate(BasisOf(3)));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  const LocalSpace nobody_there(Client::Connect("127.0.0.1:1").value());
  EXPECT_EQ(nobody_there.WaitForUpdate(0, kLocalSpaceLong)->unknown_reason(),
            Reason::kConnectionLost);
}

TEST(LocalSpace, MaxAgeMustBePositive) {
  const Client client = Client::Connect("127.0.0.1:1").value();
  EXPECT_THROW(LocalSpace(client, {.max_age = absl::ZeroDuration()}), std::invalid_argument);
  EXPECT_THROW(LocalSpace(client, {.max_age = -absl::Seconds(1)}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette::client
