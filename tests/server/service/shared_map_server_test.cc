// A server with a shared map: whatever changes in the server reaches the map.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "absl/time/clock.h"
#include "silhouette/shared_space.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using client::SharedSpace;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

bool SharedMapServerWaitUntil(const std::function<bool()>& condition) {
  for (int i = 0; i < 2000; ++i) {
    if (condition()) return true;
    absl::SleepFor(absl::Milliseconds(5));
  }
  return false;
}

struct SharedMapServer : ::testing::Test {
  ServingSettings Settings(const Policy& policy = {}) const {
    ServingSettings settings;
    settings.policy = policy;
    settings.scene.max_age = absl::Minutes(10);
    settings.shared_map.file = file;
    return settings;
  }
  static Clock Real(const Clock&) { return SystemClock; }

  SharedSpace Open() const {
    auto space = SharedSpace::Open(file);
    EXPECT_TRUE(space.ok()) << space.status();
    return *space;
  }
  // Waits until the map speaks of this scene and knows all of it.
  static bool Has(const SharedSpace& space, uint64_t scene, uint64_t unknown = 0) {
    return SharedMapServerWaitUntil([&] {
      const client::ConfigurationSpace copy = space.Copy();
      return copy.basis().scene_id == scene && copy.Count().unknown == unknown;
    });
  }
  static void ExpectSame(const SharedSpace& space, TestServer& server) {
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        EXPECT_EQ(static_cast<int>(space.Check(At(a, b)).state),
                  static_cast<int>(server.CheckOne(At(a, b)).state()) % 3)
            << a << ", " << b;  // the message has unknown last
      }
    }
  }

  const std::filesystem::path folder = FreshFolder();
  const std::string file = folder / "map";
};

TEST_F(SharedMapServer, EverySceneReachesTheMap) {
  TestServer server(NewDatabase({.missing = {{1, 1}}, .index = true}), Settings(), Real);
  const SharedSpace space = Open();
  EXPECT_EQ(space.unknown_reason(), client::Reason::kNoScene);
  uint64_t scene = 0;
  for (const SceneInput& input : {SceneWithBlock(3), EmptyCellScene(), SceneWithBlock(2, 2)}) {
    server.Publish(input);
    ASSERT_TRUE(Has(space, ++scene, 1));
    ExpectSame(space, server);
  }
  SceneInput moved = EmptyCellScene();
  moved.joints[2].position = 0.7;
  server.Publish(moved);
  EXPECT_TRUE(SharedMapServerWaitUntil(
      [&] { return space.unknown_reason() == client::Reason::kFixedJointMoved; }));
}

TEST_F(SharedMapServer, ConfigurationsThatAreTestedSinglyBecomeKnownToo) {
  TestServer server(NewDatabase({.index = true, .calibration = TestCalibration()}),
                    Settings({.preset = Preset::kCalibrated}), Real);
  const SharedSpace space = Open();
  EXPECT_EQ(space.database().default_policy.preset, "calibrated");
  server.Publish(SceneWithBlock(3));
  ASSERT_TRUE(Has(space, 1));
  ExpectSame(space, server);
}

TEST_F(SharedMapServer, IsSharedWithoutMapsWorkedOutBeforehand) {
  ServingSettings settings = Settings();
  settings.map_time = absl::ZeroDuration();
  TestServer server(NewDatabase(), settings, Real);
  server.Publish(EmptyCellScene());
  EXPECT_TRUE(Has(Open(), 1));
}

TEST_F(SharedMapServer, AllowedRegionsReachTheMap) {
  const auto database = NewDatabase();
  TestServer server(database, Settings(), Real);
  const SharedSpace space = Open();
  server.Publish(SceneWithBlock(3));
  ASSERT_TRUE(Has(space, 1));
  EXPECT_EQ(space.Check(At(3, 4)).state, client::State::kOccupied);
  v1::AllowRegionRequest request;
  request.set_name("part");
  request.mutable_duration()->set_seconds(60);
  for (int view = 0; view < 3; ++view) {
    v1::RegionPixels& pixels = *request.add_views();
    pixels.set_view(kViewNames[static_cast<size_t>(view)]);
    Set(Block(view, 3), pixels.mutable_mask());
  }
  v1::AllowRegionResponse allowed;
  grpc::ClientContext allow;
  ASSERT_TRUE(server.scene->AllowRegion(&allow, request, &allowed).ok());
  client::Basis basis;
  EXPECT_TRUE(SharedMapServerWaitUntil([&] { return space.Check(At(3, 4), &basis).free(); }));
  EXPECT_THAT(basis.regions, ElementsAre("part"));
  v1::RevokeRegionRequest revoke;
  revoke.set_name("part");
  v1::RevokeRegionResponse revoked;
  grpc::ClientContext context;
  ASSERT_TRUE(server.scene->RevokeRegion(&context, revoke, &revoked).ok());
  EXPECT_TRUE(SharedMapServerWaitUntil(
      [&] { return space.Check(At(3, 4), &basis).state == client::State::kOccupied; }));
  EXPECT_THAT(basis.regions, IsEmpty());
}

TEST_F(SharedMapServer, AnotherDatabaseClosesTheMap) {
  TestServer server(NewDatabase(), Settings(), Real);
  const SharedSpace space = Open();
  server.Publish(EmptyCellScene());
  ASSERT_TRUE(Has(space, 1));
  server.server->ReplaceDatabase(NewDatabase());
  EXPECT_TRUE(SharedMapServerWaitUntil(
      [&] { return space.unknown_reason() == client::Reason::kMapClosed; }));
  const SharedSpace next = space.Reopen().value();
  EXPECT_TRUE(SharedMapServerWaitUntil(
      [&] { return next.unknown_reason() == client::Reason::kGenerationMismatch; }));
  server.Publish(EmptyCellScene());
  EXPECT_TRUE(Has(next, 2));
}

TEST_F(SharedMapServer, StopClosesTheMapAndRemovesTheFile) {
  TestServer server(NewDatabase(), Settings(), Real);
  const SharedSpace space = Open();
  server.Publish(EmptyCellScene());
  ASSERT_TRUE(Has(space, 1));
  server.server->Stop(absl::Seconds(1));
  EXPECT_TRUE(SharedMapServerWaitUntil(
      [&] { return space.unknown_reason() == client::Reason::kMapClosed; }));
  EXPECT_TRUE(SharedMapServerWaitUntil([&] { return !std::filesystem::exists(file); }));
}

TEST_F(SharedMapServer, FileThatCannotBeMadeIsToldAtTheStart) {
  const auto start = [&](const ServingSettings& settings) {
    return Server::Start("unix:" + (folder / "s").string(), NewDatabase(), settings).status();
  };
  ServingSettings settings = Settings();
  settings.shared_map.mode = 0666;
  EXPECT_EQ(start(settings).code(), absl::StatusCode::kInvalidArgument);
  settings = Settings();
  settings.shared_map.file = folder / "nowhere/map";
  EXPECT_THAT(std::string(start(settings).message()), HasSubstr("No such file"));
  TestServer server(NewDatabase(), Settings(), Real);
  EXPECT_THAT(std::string(start(Settings()).message()), HasSubstr("another server"));
  EXPECT_TRUE(SharedSpace::Open(file).ok());
  EXPECT_FALSE(std::filesystem::exists(folder / "s")) << "it did not begin to listen";
}

}  // namespace
}  // namespace silhouette
