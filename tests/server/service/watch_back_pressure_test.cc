// SPDX-License-Identifier: Apache-2.0
// Watchers of a large space: of some of its tiles, and those that do not read, or not as quickly as
// scenes come. Not under the thread sanitizer, which takes minutes over megabytes that gRPC's
// uninstrumented threads hand to each other.
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

// A database of which a block changes 1024 tiles: updates of a megabyte, more than a transport
// takes unread.
std::shared_ptr<const ServedDatabase> LargeDatabase() {
  storage::v1::CellDescription cell = ServerTestCell();
  for (storage::v1::GridJoint& joint : *cell.mutable_grid_joints()) joint.set_steps(2048);
  const std::filesystem::path folder = FreshFolder();
  const std::string path = folder / "db";
  {
    const auto database = Database::Create(path, cell);
    EXPECT_TRUE(database.ok()) << database.status();
    auto writer = (*database)->Write("test");
    for (uint64_t tile = 0; tile < (*database)->grid().tiles(); ++tile) {
      RobotImage image;
      image.number = tile * kTileSize;
      for (int view = 0; view < 3; ++view) image.masks.push_back(RobotMask(view, 3, 0));
      EXPECT_TRUE(writer->Put(image).ok());
    }
    // Where the robot stands.
    RobotImage standing = TestRobotImage((*database)->grid(), 0, 0);
    standing.number = (*database)->grid().NumberOf({1, 1});
    EXPECT_TRUE(writer->Put(standing).ok());
    EXPECT_TRUE(writer->Commit().ok());
  }
  BuildIndex(path);
  return LoadDatabase(path);
}

// The robot stands at grid point (1, 1) of that database.
SceneInput InLargeDatabase(const ConfigurationGrid& grid, SceneInput input) {
  input.joints = JointsAt(grid.At(grid.NumberOf({1, 1})));
  return input;
}

TEST(WatchTiles, OnlyThoseAskedForAreSent) {
  const auto database = LargeDatabase();
  TestServer server(database);
  server.Publish(InLargeDatabase(database->grid(), EmptyCellScene()));
  v1::WatchConfigurationSpaceRequest request;
  request.add_tiles(1000);
  request.add_tiles(7);
  SpaceWatching watching(server, request);
  EXPECT_EQ(watching.Next().tiles, 2u);
  server.Publish(InLargeDatabase(database->grid(), SceneWithBlock(3)));
  EXPECT_EQ(watching.Next().tiles, 2u);
  EXPECT_THAT(watching.free(), ::testing::ElementsAre(::testing::Key(7u), ::testing::Key(1000u)));
}

TEST(WatchBackPressure, SlowReaderSkipsToTheNewestSceneAndHoldsBackNobody) {
  const auto database = LargeDatabase();
  ServingSettings settings;
  settings.longest_write = absl::Hours(1);
  TestServer server(database, settings);
  const SceneInput empty = InLargeDatabase(database->grid(), EmptyCellScene());
  const SceneInput block = InLargeDatabase(database->grid(), SceneWithBlock(3));
  server.Publish(empty);
  SpaceWatching slow(server);
  SpaceWatching quick(server);
  slow.Next();
  quick.Next();
  constexpr uint64_t kScenes = 40;
  for (uint64_t scene = 2; scene <= kScenes; ++scene) {
    server.Publish(scene % 2 == 0 ? block : empty);
    const SpaceUpdate update = quick.Next();
    EXPECT_EQ(update.first.basis().scene_id(), scene);
    EXPECT_EQ(update.tiles, database->grid().tiles());
  }
  uint64_t told = 1;
  uint64_t skipped = 0;
  while (told + skipped < kScenes) {
    const SpaceUpdate update = slow.Next();
    ++told;
    skipped += update.first.skipped_scenes();
    EXPECT_EQ(update.first.basis().scene_id(), told + skipped);
  }
  EXPECT_EQ(slow.free(), quick.free());
  EXPECT_GT(skipped, kScenes / 2);
}

// Of a server that takes one stream of a client: waits until another stream finds its place free.
void WaitForTheStreamsPlace(TestServer& server) {
  grpc::StatusCode code = grpc::StatusCode::RESOURCE_EXHAUSTED;
  for (int tries = 0; tries < 600 && code == grpc::StatusCode::RESOURCE_EXHAUSTED; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    grpc::ClientContext context;
    const auto stream = server.collision->StreamChecks(&context);
    stream->WritesDone();
    code = stream->Finish().error_code();
  }
  EXPECT_EQ(code, grpc::StatusCode::OK);
}

TEST(WatchBackPressure, WhoTakesNothingIsCutOff) {
  const auto database = LargeDatabase();
  ServingSettings settings;
  settings.longest_write = absl::Seconds(2);
  settings.limits.streams_per_client = 1;
  TestServer server(database, settings);
  server.Publish(InLargeDatabase(database->grid(), EmptyCellScene()));
  SpaceWatching stalled(server);
  stalled.Next();
  for (int i = 0; i < 10; ++i) {
    const SceneInput input = i % 2 == 0 ? SceneWithBlock(3) : EmptyCellScene();
    server.Publish(InLargeDatabase(database->grid(), input));
    std::this_thread::sleep_for(std::chrono::milliseconds(60));
  }
  WaitForTheStreamsPlace(server);
  EXPECT_EQ(stalled.Finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST(WatchBackPressure, WhoTakesNoConfigurationSpaceIsCutOffAndCountsAsAStreamUntilThen) {
  const auto database = LargeDatabase();
  ServingSettings settings;
  settings.longest_write = absl::Seconds(2);
  settings.limits.streams_per_client = 1;
  TestServer server(database, settings);
  server.Publish(InLargeDatabase(database->grid(), EmptyCellScene()));
  // Ten megabytes: more than a transport takes unread.
  v1::GetConfigurationSpaceRequest request;
  for (int level = 0; level < 16; ++level) request.add_clearance_levels(level);
  grpc::ClientContext context;
  const auto stalled = server.collision->GetConfigurationSpace(&context, request);
  v1::GetConfigurationSpaceResponse message;
  EXPECT_TRUE(stalled->Read(&message));
  grpc::ClientContext second;
  EXPECT_EQ(server.collision->GetConfigurationSpace(&second, request)->Finish().error_code(),
            grpc::StatusCode::RESOURCE_EXHAUSTED);
  WaitForTheStreamsPlace(server);
  while (stalled->Read(&message)) continue;
  EXPECT_EQ(stalled->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST(WatchBackPressure, WhoTakesNoAnswersOfAStreamIsCutOff) {
  ServingSettings settings;
  settings.longest_write = absl::Seconds(2);
  TestServer server(NewDatabase(), settings);
  server.Publish(EmptyCellScene());
  grpc::ClientContext context;
  // If nothing cuts it off.
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(5));
  const auto stalled = server.collision->StreamChecks(&context);
  v1::StreamChecksRequest request;
  for (int i = 0; i < 10'000; ++i)
    Set(At(0, 0), request.mutable_configurations()->add_configurations());
  while (stalled->Write(request)) continue;
  v1::StreamChecksResponse answer;
  while (stalled->Read(&answer)) continue;
  EXPECT_EQ(stalled->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

}  // namespace
}  // namespace silhouette
