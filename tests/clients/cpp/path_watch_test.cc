// SPDX-License-Identifier: Apache-2.0
// A path that is watched: the newest verdict, and how long it may be relied on.
#include "silhouette/path_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "silhouette/client.h"
#include "tests/clients/cpp/watched_space.h"

namespace silhouette::client {
namespace {

using ::testing::HasSubstr;

const std::vector<Configuration> kPath = {{0.0, 0.0}, {1.0, 2.0}};
constexpr absl::Duration kPathWatchLong = absl::Seconds(20);

// How long updates are valid in tests that wait until they expire.
constexpr absl::Duration kShort = absl::Milliseconds(200);

v1::WatchPathResponse Free(const v1::Basis& basis) {
  v1::WatchPathResponse response;
  *response.mutable_check()->mutable_basis() = basis;
  response.mutable_check()->mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
  return response;
}

// A fake server that tells its clock, and answers with `responses`, then waits to be cancelled or
// ends with `end`.
struct PathServer {
  explicit PathServer(std::vector<v1::WatchPathResponse> given,
                      std::optional<grpc::Status> end = std::nullopt)
      : responses(std::move(given)) {
    server.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
      *response.mutable_basis() = BasisOf(1);
      return grpc::Status::OK;
    };
    server.watch_path = [this, end](grpc::ServerContext& context,
                                    const v1::CheckPathRequest& request,
                                    grpc::ServerWriter<v1::WatchPathResponse>& writer) {
      EXPECT_EQ(request.waypoints_size(), 2);
      EXPECT_EQ(request.policy().preset(), "paper");
      for (const v1::WatchPathResponse& response : responses) writer.Write(response);
      if (end) return *end;
      while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
      cancelled = true;
      return grpc::Status::CANCELLED;
    };
  }

  PathWatch Watch(Clearance clearance = Clearance::kOmit) const {
    const Client client = ClientOfHere(server);
    return client.WatchPath(kPath, {.preset = "paper"}, clearance).value();
  }

  const std::vector<v1::WatchPathResponse> responses;
  std::atomic<bool> cancelled = false;
  FakeServer server;  // last: it goes first
};

TEST(PathWatch, TellsTheVerdictAndWhatItRestsOn) {
  v1::WatchPathResponse response = Free(BasisOf(3, absl::Milliseconds(20)));
  response.set_skipped_scenes(4);
  response.mutable_check()->set_checked(17);
  const PathServer server({response});
  PathWatch watch = server.Watch();
  const auto update = watch.Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->FreeNow());
  EXPECT_EQ(update->check.checked, 17);
  EXPECT_EQ(update->check.basis.scene_id, 3u);
  EXPECT_EQ(update->skipped_scenes, 4u);
  EXPECT_GE(update->check.basis.Age(), absl::Milliseconds(20));
  EXPECT_LT(update->check.basis.Age(), absl::Seconds(10));
  EXPECT_EQ(watch.Next(absl::Seconds(1)).status(),
            absl::DeadlineExceededError("no new verdict on the path came within 1 s"))
      << "each update is returned once";
}

TEST(PathWatch, IsAskedWithItsResolution) {
  FakeServer server;
  std::atomic<double> asked = 0;
  server.watch_path = [&](auto&, const v1::CheckPathRequest& request, auto&) {
    asked = request.path_resolution();
    return grpc::Status::OK;
  };
  PathWatch watch =
      ClientOfHere(server).WatchPath(kPath, {}, Clearance::kOmit, /*resolution=*/0.001).value();
  EXPECT_EQ(watch.Next(kPathWatchLong).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(asked, 0.001);
}

TEST(PathWatch, PathThatIsNotFreeIsNot) {
  v1::WatchPathResponse response = Free(BasisOf(3));
  response.mutable_check()->mutable_verdict()->set_state(v1::Verdict::STATE_OCCUPIED);
  response.mutable_check()->set_segment(1);
  PathServer server({response});
  const auto update = server.Watch().Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_FALSE(update->FreeNow());
  EXPECT_EQ(update->check.verdict.state, State::kOccupied);
  EXPECT_EQ(update->check.segment, 1);
}

TEST(PathWatch, IsNotFreeAnyMoreWhenTheServerNoLongerVouches) {
  v1::WatchPathResponse response = Free(BasisOf(3));
  Set(absl::Milliseconds(300), response.mutable_check()->mutable_basis()->mutable_valid_for());
  PathServer server({response});
  const auto update = server.Watch().Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_FALSE(update->FreeNow());
  EXPECT_FALSE(PathUpdate().FreeNow());
}

TEST(PathWatch, MessageThatWaitedOnItsWayIsAsOldAsItIs) {
  const PathServer server({Free(BasisOf(3, absl::ZeroDuration(), /*ago=*/absl::Seconds(70)))});
  const auto update = server.Watch().Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_GE(update->check.basis.Age(), absl::Seconds(70));
  EXPECT_FALSE(update->FreeNow()) << "it was valid for a minute";
  EXPECT_EQ(update->check.verdict.reason, Reason::kUpdateExpired);
}

TEST(PathWatch, WakesWhoWaitsWhenAFreeVerdictExpires) {
  v1::WatchPathResponse response = Free(BasisOf(3));
  Set(kShort, response.mutable_check()->mutable_basis()->mutable_valid_for());
  response.set_skipped_scenes(4);
  const PathServer server({response});
  PathWatch watch = server.Watch();
  auto update = watch.Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_FALSE(update->repeated);
  if (update->check.verdict.free()) {  // else this machine was too busy
    update = watch.Next(kPathWatchLong);
    ASSERT_TRUE(update.ok()) << update.status();
    EXPECT_TRUE(update->repeated);
    EXPECT_EQ(update->skipped_scenes, 0u);
  }
  EXPECT_EQ(update->check.verdict.state, State::kUnknown);
  EXPECT_EQ(update->check.verdict.reason, Reason::kUpdateExpired);
  EXPECT_EQ(update->check.basis.scene_id, 3u);
  EXPECT_EQ(watch.Next(absl::Milliseconds(300)).status().code(),
            absl::StatusCode::kDeadlineExceeded)
      << "it expires once";
}

TEST(PathWatch, WakesWhoWaitsWhenASpeedLevelExpires) {
  v1::WatchPathResponse response = Free(BasisOf(3));
  response.mutable_check()->mutable_separation()->set_level(2);
  Set(kShort, response.mutable_check()->mutable_separation()->mutable_valid_for());
  const PathServer server({response});
  PathWatch watch =
      ClientOfHere(server.server)
          .WatchPath(kPath, {.preset = "paper"}, Clearance::kOmit, {}, SeparationPolicy{})
          .value();
  auto update = watch.Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  if (update->check.separation->level > 0) {  // else this machine was too busy
    update = watch.Next(kPathWatchLong);
    ASSERT_TRUE(update.ok()) << update.status();
  }
  EXPECT_EQ(update->check.separation->level, 0);
  EXPECT_EQ(update->check.separation->unknown_reason, Reason::kUpdateExpired);
  EXPECT_TRUE(update->FreeNow()) << "the verdict is valid for a minute";
}

TEST(PathWatch, NeverReturnsAsFreeWhatExpiredWhileNobodyAsked) {
  v1::WatchPathResponse response = Free(BasisOf(3));
  Set(kShort, response.mutable_check()->mutable_basis()->mutable_valid_for());
  const PathServer server({response});
  PathWatch watch = server.Watch();
  std::this_thread::sleep_for(absl::ToChronoMilliseconds(kShort));
  const auto update = watch.Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_EQ(update->check.verdict.reason, Reason::kUpdateExpired);
}

TEST(PathWatch, WhoAsksSeldomGetsTheNewestAndIsToldWhatWasSkipped) {
  std::vector<v1::WatchPathResponse> responses;
  for (uint64_t scene = 1; scene <= 50; ++scene) responses.push_back(Free(BasisOf(scene)));
  responses.back().set_skipped_scenes(2);
  PathServer server(responses);
  PathWatch watch = server.Watch();
  uint64_t last = 0;
  uint64_t told = 0;
  int returned = 0;
  while (last < 50) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const auto update = watch.Next(kPathWatchLong);
    ASSERT_TRUE(update.ok()) << update.status();
    last = update->check.basis.scene_id;
    told += update->skipped_scenes;
    ++returned;
  }
  EXPECT_LT(returned, 50);
  EXPECT_EQ(told, 50u - static_cast<uint64_t>(returned) + 2);
}

TEST(PathWatch, IsOverIfTheServersClockIsNotKnownInTime) {
  PathServer server({Free(BasisOf(3))});
  server.server.check_configurations = [](grpc::ServerContext& context, auto&, auto&) {
    while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return grpc::Status::CANCELLED;
  };
  const Client client = ClientOfHere(server.server).WithTimeout(absl::Milliseconds(100));
  PathWatch watch = client.WatchPath(kPath, {.preset = "paper"}).value();
  for (int i = 0; i < 2; ++i) {
    const absl::Status over = watch.Next(kPathWatchLong).status();
    EXPECT_EQ(over.code(), absl::StatusCode::kUnavailable) << "it does not continue: " << over;
  }
}

TEST(PathWatch, SlowRoundTripsMakeItLateNotBlind) {
  PathServer server({Free(BasisOf(3))});
  server.server.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1200));
    *response.mutable_basis() = BasisOf(1);
    return grpc::Status::OK;
  };
  const auto update = server.Watch().Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->FreeNow());
  EXPECT_GE(update->check.basis.Age(), absl::Milliseconds(1200));
}

TEST(PathWatch, CancelEndsItFromAnotherThread) {
  const PathServer server({});
  PathWatch watch = server.Watch();
  std::jthread other([&watch] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    watch.Cancel();
  });
  EXPECT_EQ(watch.Next().status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(watch.Next().status().code(), absl::StatusCode::kCancelled);
}

TEST(PathWatch, ThatGoesAwayEndsItsCall) {
  const PathServer server({Free(BasisOf(3))});
  {
    PathWatch watch = server.Watch();
    ASSERT_TRUE(watch.Next(kPathWatchLong).ok());
  }
  for (int i = 0; i < 5000 && !server.cancelled; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_TRUE(server.cancelled);
}

TEST(PathWatch, LostStreamIsAnErrorAndWhatCameBeforeIsNotHandedOut) {
  for (const auto code : {grpc::StatusCode::UNAVAILABLE, grpc::StatusCode::OK}) {
    const PathServer server({Free(BasisOf(3))}, grpc::Status(code, "stops"));
    PathWatch watch = server.Watch();
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    for (int i = 0; i < 2; ++i) {
      const auto update = watch.Next(kPathWatchLong);
      if (i == 0 && update.ok()) continue;  // a busy machine: the end had not come yet
      EXPECT_EQ(update.status().code(), absl::StatusCode::kUnavailable);
      EXPECT_THAT(std::string(update.status().message()), HasSubstr(server.server.address));
    }
  }
}

TEST(PathWatch, EndThatNoCancelAndNoDeadlineOfThisClientMadeIsALoss) {
  for (const auto code : {grpc::StatusCode::CANCELLED, grpc::StatusCode::DEADLINE_EXCEEDED}) {
    const PathServer server({Free(BasisOf(3))}, grpc::Status(code, "ended by a proxy"));
    PathWatch watch = server.Watch();
    absl::StatusOr<PathUpdate> update = watch.Next(kPathWatchLong);
    if (update.ok()) update = watch.Next(kPathWatchLong);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(update.status(),
                absl::UnavailableError("the server at " + server.server.address +
                                       ", or a proxy on the way, ended the call; call again"));
      update = watch.Next(kPathWatchLong);
    }
  }
}

TEST(PathWatch, AnswerThatCannotBeUsedIsAnError) {
  const auto code_of = [](const v1::WatchPathResponse& response, Clearance clearance) {
    const PathServer server({response});
    return server.Watch(clearance).Next(kPathWatchLong).status().code();
  };
  v1::WatchPathResponse response = Free(BasisOf(3));
  response.mutable_check()->mutable_basis()->clear_valid_for();
  EXPECT_EQ(code_of(response, Clearance::kOmit), absl::StatusCode::kUnimplemented);
  response = Free(BasisOf(3));
  EXPECT_EQ(code_of(response, Clearance::kMeasure), absl::StatusCode::kUnimplemented);
  response.mutable_check()->mutable_basis()->clear_server_clock();
  EXPECT_EQ(code_of(response, Clearance::kOmit), absl::StatusCode::kUnimplemented);
  response.mutable_check()->clear_basis();
  EXPECT_EQ(code_of(response, Clearance::kOmit), absl::StatusCode::kUnimplemented);
}

TEST(PathWatch, WithoutASceneOrAStateIsUnknown) {
  v1::WatchPathResponse response = Free(BasisOf(0));
  const PathServer without_scene({response});
  auto update = without_scene.Watch().Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_EQ(update->check.verdict.reason, Reason::kNoScene);
  EXPECT_FALSE(update->FreeNow());
  response = Free(BasisOf(3));
  response.mutable_check()->mutable_verdict()->set_state(static_cast<v1::Verdict::State>(9));
  const PathServer newer({response});
  update = newer.Watch().Next(kPathWatchLong);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_EQ(update->check.verdict.state, State::kUnknown);
}

TEST(PathWatch, ServerThatCannotIsNamed) {
  FakeServer server;
  const Client client = ClientOfHere(server);
  EXPECT_EQ(client.WatchPath(kPath).value().Next(kPathWatchLong).status().code(),
            absl::StatusCode::kUnimplemented);
  EXPECT_EQ(client.WatchPath({}).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace silhouette::client
