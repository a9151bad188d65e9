// SPDX-License-Identifier: Apache-2.0
// silhouette-server when something hangs, is damaged or full.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/db/store/full_disk.h"
#include "tests/folders.h"
#include "tests/server/service/raw_call.h"
#include "tests/server/service/test_server.h"
#include "tests/server/test_cell.h"
#include "tests/test_folder.h"
#include "tests/tools/silhouette-server/server_program.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Waits until a program reads this FIFO; returns the writing end.
int AwaitReader(const std::string& fifo) {
  for (;;) {
    const int writer = open(fifo.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    if (writer >= 0) return writer;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

TEST_F(ServerProgramTest, EndsAtOnceWithZeroWhileItStillLoads) {
  // A cell file whose end never comes.
  std::filesystem::remove(cell);
  ASSERT_EQ(mkfifo(cell.c_str(), 0600), 0);
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const int writer = AwaitReader(cell);
  EXPECT_EQ(program.End(SIGTERM), 0);
  EXPECT_EQ(program.Errors(), "");
  close(writer);
}

TEST_F(ServerProgramTest, EndsThoughAThreadOfItsOwnHangs) {
  const std::string check = folder / "check.json";
  WriteFile(check, "");
  ServerProgram program(folder, {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0",
                                 "--calibration-check", check});
  EXPECT_NE(program.Address(), "");
  // A file whose end never comes, like one of a server that is gone.
  const std::string endless = folder / "endless";
  ASSERT_EQ(mkfifo(endless.c_str(), 0600), 0);
  std::filesystem::rename(endless, check);
  const int writer = AwaitReader(check);
  EXPECT_EQ(program.End(SIGTERM), 3);
  EXPECT_THAT(program.Errors(), HasSubstr("ended while something hangs"));
  close(writer);
}

TEST_F(ServerProgramTest, EndsWithZeroAndRecordsItThoughAReloadHangs) {
  std::string text = kServerTestCellFile;
  text.replace(text.find("[16, 12]}"), 9, "[16, 12], ignore: pillar.png}");
  WriteFile(cell, text + "server: {audit: audit.jsonl}\n");
  const std::string pillar = folder / "pillar.png";
  WriteFile(pillar, PngOf(cv::Mat(12, 16, CV_8UC1, cv::Scalar(0))));
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  EXPECT_NE(program.Address(), "");
  const std::string endless = folder / "endless";
  ASSERT_EQ(mkfifo(endless.c_str(), 0600), 0);
  std::filesystem::rename(endless, pillar);
  program.Signal(SIGHUP);
  const int writer = AwaitReader(pillar);
  EXPECT_EQ(program.End(SIGTERM), 0);
  EXPECT_THAT(ContentOf(folder / "audit.jsonl"), HasSubstr("server.stop"));
  close(writer);
}

// A server of a database with a collision index, and scenes for it.
struct DamagedFileTest : ServerProgramTest {
  void SetUp() override {
    ServerProgramTest::SetUp();
    database = folder / "indexed";
    MakeDatabase(database, {.index = true, .cell = DescriptionOf(*LoadCell(cell))});
    program.emplace(folder, std::vector<std::string>{"--cell", cell, "--database", database,
                                                     "--listen", "127.0.0.1:0"});
    channel = grpc::CreateChannel(program->Address(), grpc::InsecureChannelCredentials());
  }

  // A scene with a block, and its map.
  v1::GetConfigurationSpaceResponse NewMap() {
    SceneInput input = SceneWithBlock(3);
    for (ViewInput& view : input.views) view.captured = SystemClock();
    grpc::ClientContext publishing, asking;
    v1::PublishSceneResponse published;
    const grpc::Status status =
        v1::SceneService::NewStub(channel)->PublishScene(&publishing, RequestOf(input), &published);
    EXPECT_TRUE(status.ok()) << status.error_message();
    v1::GetConfigurationSpaceResponse map;
    const auto reader = v1::CollisionService::NewStub(channel)->GetConfigurationSpace(&asking, {});
    EXPECT_TRUE(reader->Read(&map));
    v1::GetConfigurationSpaceResponse rest;
    EXPECT_FALSE(reader->Read(&rest));
    EXPECT_TRUE(reader->Finish().ok());
    return map;
  }

  // Whether all 8 configurations are occupied that the block is in the way of.
  static bool BlockIsOccupied(const v1::GetConfigurationSpaceResponse& map) {
    const ConfigurationGrid grid = *GridOf(ServerTestCell());
    if (map.tiles_size() != 1) return false;
    for (int b = 0; b < 8; ++b) {
      const uint64_t place = grid.NumberOf({3, b});
      if ((map.tiles(0).occupied()[place / 8] >> (place % 8) & 1) == 0) return false;
    }
    return true;
  }

  void WaitForLog(const std::string& text) const {
    for (int i = 0; i < 1000 && program->Errors().find(text) == std::string::npos; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_THAT(program->Errors(), HasSubstr(text));
  }

  std::optional<ServerProgram> program;
  std::shared_ptr<grpc::Channel> channel;
};

TEST_F(DamagedFileTest, PagesZeroedUnderARunningServerMakeAllUnknownUntilItReloads) {
  EXPECT_TRUE(BlockIsOccupied(NewMap()));
  EXPECT_EQ(HealthOf(channel, "silhouette.v1.Database"), "\x08\x01");
  ZeroIndex(**Database::Open(database, Database::Access::kRead));
  WaitForLog("nothing is free: the file of the database '" + database + "' has changed");
  EXPECT_EQ(NewMap().unknown_reason(), v1::Verdict::REASON_DATABASE_DAMAGED);
  const std::string not_serving = "\x08\x02";
  for (int i = 0; i < 1000 && HealthOf(channel, "silhouette.v1.Database") != not_serving; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(HealthOf(channel, "silhouette.v1.Database"), not_serving);
  program->Signal(SIGHUP);
  WaitForLog("reloaded; ");
  const v1::GetConfigurationSpaceResponse map = NewMap();
  EXPECT_EQ(map.unknown_reason(), v1::Verdict::REASON_UNSPECIFIED);
  EXPECT_TRUE(BlockIsOccupied(map)) << "without the damaged tile";
}

TEST_F(DamagedFileTest, FileCutUnderARunningServerMakesAllUnknown) {
  EXPECT_TRUE(BlockIsOccupied(NewMap()));
  std::filesystem::resize_file(database + "/data.mdb", 8192);
  WaitForLog("nothing is free: the file of the database");
  EXPECT_EQ(NewMap().unknown_reason(), v1::Verdict::REASON_DATABASE_DAMAGED);
  program->Signal(SIGHUP);
  WaitForLog("not reloaded, and nothing is free");
  EXPECT_EQ(NewMap().unknown_reason(), v1::Verdict::REASON_DATABASE_DAMAGED);
  EXPECT_EQ(program->End(SIGTERM), 0);
}

using FullDiskOfAServer = FullDisk;

TEST_F(FullDiskOfAServer, LeavesItsVerdictsAndLosesNoRecordOfAChange) {
  const std::string cell = disk_ + "/cell.yaml";
  WriteFile(cell, std::string(kServerTestCellFile) +
                      "database: db\nserver: {max_age: 1 min, audit: audit.jsonl}\n");
  MakeDatabase(disk_ + "/db", {.index = true, .cell = DescriptionOf(*LoadCell(cell))});
  ServerProgram program(FreshFolder(), {"--cell", cell, "--listen", "127.0.0.1:0"});
  const auto channel = grpc::CreateChannel(program.Address(), grpc::InsecureChannelCredentials());
  const auto logged = [&](const std::string& text) {
    return program.Errors().find(text) != std::string::npos;
  };
  const auto wait_until = [](const std::function<bool()>& so) {
    for (int i = 0; i < 12'000 && !so(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ASSERT_TRUE(so());
  };
  const auto recorded = [&] {
    int changes = 0;
    std::ifstream audit(disk_ + "/audit.jsonl");
    for (std::string line; std::getline(audit, line);) {
      if (line.find("region.allow") != std::string::npos) ++changes;
    }
    return changes;
  };
  // Of a scene with a block: where it is not, and where it is.
  const auto verdicts = [&] {
    SceneInput input = SceneWithBlock(3);
    for (ViewInput& view : input.views) view.captured = SystemClock();
    grpc::ClientContext publishing, asking;
    v1::PublishSceneResponse published;
    EXPECT_TRUE(v1::SceneService::NewStub(channel)
                    ->PublishScene(&publishing, RequestOf(input), &published)
                    .ok());
    v1::CheckConfigurationsRequest request;
    for (const int a : {1, 3}) Set(At(a, 0), request.add_configurations());
    v1::CheckConfigurationsResponse response;
    EXPECT_TRUE(v1::CollisionService::NewStub(channel)
                    ->CheckConfigurations(&asking, request, &response)
                    .ok());
    std::vector<v1::Verdict::State> states;
    for (const v1::Verdict& verdict : response.verdicts()) states.push_back(verdict.state());
    return states;
  };
  const auto right = ElementsAre(v1::Verdict::STATE_FREE, v1::Verdict::STATE_OCCUPIED);
  EXPECT_THAT(verdicts(), right);
  Fill();
  program.Signal(SIGHUP);
  wait_until([&] { return logged("reloaded; "); });
  // The file's last page has room for some.
  int changes = 0;
  for (; !logged("cannot write the audit file"); ++changes) {
    ASSERT_LT(changes, 1000) << program.Errors();
    grpc::ClientContext context;
    v1::AllowRegionResponse allowed;
    ASSERT_TRUE(v1::SceneService::NewStub(channel)
                    ->AllowRegion(&context, RegionAt("part", 1, absl::Minutes(1)), &allowed)
                    .ok());
  }
  EXPECT_THAT(verdicts(), right);
  Empty();
  wait_until([&] { return logged("is written again") && recorded() >= changes; });
  EXPECT_THAT(verdicts(), right);
  EXPECT_EQ(program.End(SIGTERM), 0);
  EXPECT_EQ(recorded(), changes);
  const std::string verify = absl::StrCat(ProgramFolder(), "/silhouette-db audit verify ", disk_,
                                          "/audit.jsonl > /dev/null");
  EXPECT_EQ(std::system(verify.c_str()), 0);
}

TEST_F(ServerProgramTest, TruncatedDatabaseIsTold) {
  const std::string file = database + "/data.mdb";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 3);
  EXPECT_THAT(errors, HasSubstr(database));
}

}  // namespace
}  // namespace silhouette
