// SPDX-License-Identifier: Apache-2.0
// silhouette-record and `silhouette replay` against real servers, as a user runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "common/recording/recording.h"
#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "tests/clients/cpp/fake_server.h"
#include "tests/folders.h"
#include "tests/tools/silhouette/small_served_cell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// A path through the wall.
constexpr char kPath[] = "0,0 1,0";

class RecordProgram : public ::testing::Test {
 protected:
  void Publish(const Mask& obstacle) {
    const Ended ended = cell_.Publish(obstacle, obstacle);
    ASSERT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  }

  std::unique_ptr<Process> Start(const std::string& command, const std::string& output) const {
    return std::make_unique<Process>(
        std::vector<std::string>{"/bin/sh", "-c",
                                 "cd " + cell_.shell().folder().string() +
                                     " && exec env "
                                     "SILHOUETTE_SERVER=" +
                                     cell_.address() + " " + ProgramFolder() + "/" + command},
        cell_.shell().folder() / output);
  }

  bool Has(const std::string& file, const std::string& text) const {
    for (int i = 0; i < 500; ++i) {
      if (ContentOf(cell_.shell().folder() / file).find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << file << ": " << ContentOf(cell_.shell().folder() / file);
    return false;
  }

  // The files of the folder "r" whose names begin like this.
  std::vector<std::string> Files(const std::string& start) const {
    std::vector<std::string> files;
    for (const auto& entry : fs::directory_iterator(cell_.shell().folder() / "r")) {
      if (entry.path().filename().string().starts_with(start)) files.push_back(entry.path());
    }
    std::ranges::sort(files);
    return files;
  }

  // Free, occupied by the wall, and free again, while a client watches a path; then the end.
  void RecordAStop(const std::string& options, const std::string& watched = kPath) {
    Publish(kNothing);
    const auto record = Start("silhouette-record --folder r --format json " + options, "record");
    const auto watch = Start("silhouette watch " + watched + " --format json", "watch");
    ASSERT_TRUE(Has("watch", "\"state\":\"free\""));
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    Publish(kWall);
    ASSERT_TRUE(Has("record", "\"event\":\"stop\""));
    WriteFile(cell_.shell().folder() / "stopped", cell_.Run("path --format json " + watched).out);
    Publish(kNothing);
    ASSERT_TRUE(Has("watch", "\"scene_id\":3"));
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    watch->Stop();
    ASSERT_EQ(record->End(SIGINT), 0) << ContentOf(cell_.shell().folder() / "record");
  }

  Ended Replay(const std::string& arguments) const { return cell_.Run("replay " + arguments); }

  SmallServedCell cell_;
};

TEST_F(RecordProgram, RecordsScenesPathsAndStops) {
  RecordAStop("");
  const std::vector<std::string> files = Files("recording-");
  ASSERT_THAT(files, SizeIs(1));
  ASSERT_THAT(Files("stop-"), SizeIs(1));
  const Json record = Json::parse([&] {
    const std::string text = ContentOf(cell_.shell().folder() / "record");
    return text.substr(text.find("{\"event\":\"end\""));
  }());
  EXPECT_EQ(record["scenes"], 3);
  EXPECT_EQ(record["missed_scenes"], 0);
  EXPECT_EQ(record["lost_messages"], 0);
  EXPECT_EQ(record["stops"], 1);
  for (const std::string& file : {files[0], Files("stop-")[0]}) {
    const Ended ended = Replay(file + " --format json");
    ASSERT_EQ(ended.exit_code, 0) << ended.err;
    const Json summary = Json::parse(ended.out);
    EXPECT_EQ(summary["cell"], "block");
    EXPECT_EQ(summary["scenes"], 3);
    EXPECT_EQ(summary["cut"], false);
    ASSERT_THAT(summary["stops"], SizeIs(1));
    EXPECT_EQ(summary["stops"][0]["verdict"], "occupied");
  }
}

TEST_F(RecordProgram, OnlyStopsLeavesOutTheRest) {
  RecordAStop("--only-stops");
  EXPECT_THAT(Files("recording-"), IsEmpty());
  EXPECT_THAT(Files("stop-"), SizeIs(1));
}

TEST_F(RecordProgram, SecondRecorderOfAFolderIsRefusedAndTheFirstKeepsItsFile) {
  Publish(kNothing);
  const auto first = Start("silhouette-record --folder r --files 1", "first");
  std::vector<std::string> files;
  for (int i = 0; i < 500 && files.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    if (fs::exists(cell_.shell().folder() / "r")) files = Files("recording-");
  }
  ASSERT_THAT(files, SizeIs(1));
  const Ended second = cell_.shell().Run(ProgramFolder() + "/silhouette-record " + cell_.address() +
                                         " --folder r/ --files 1");
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_THAT(second.err, AllOf(HasSubstr("--folder r/: another silhouette-record writes into it"),
                                HasSubstr("one folder per recorder")));
  EXPECT_EQ(Files("recording-"), files);
  ASSERT_EQ(first->End(SIGINT), 0);
  const auto third = Start("silhouette-record --folder r --files 2", "third");
  for (int i = 0; i < 500 && Files("recording-").size() < 2; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_THAT(Files("recording-"), SizeIs(2)) << "the folder is free again";
  EXPECT_EQ(third->End(SIGINT), 0);
}

TEST_F(RecordProgram, StopThatTheDiskDoesNotTakeIsSaidToWaitAndIsWrittenLater) {
  Publish(kNothing);
  const auto record = Start("silhouette-record --folder r --only-stops", "record");
  const auto watch = Start("silhouette watch " + std::string(kPath) + " --format json", "watch");
  ASSERT_TRUE(Has("watch", "\"state\":\"free\""));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const fs::path folder = cell_.shell().folder() / "r";
  ASSERT_TRUE(fs::remove(folder));
  Publish(kWall);
  ASSERT_TRUE(Has("record", "(occupied); waits in memory for the disk"));
  fs::create_directory(folder);
  ASSERT_TRUE(Has("record", "the disk takes the recording again"));
  ASSERT_EQ(record->End(SIGINT), 0);
  const auto recording = Recording::Open(Files("stop-").at(0));
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->summary().stops, SizeIs(1));
}

TEST_F(RecordProgram, StopAfterWhichTheServerAnswersNoMoreIsKept) {
  const auto database = Client::Connect(cell_.address())->GetDatabase();
  ASSERT_TRUE(database.ok()) << database.status();
  const grpc::Status gone(grpc::StatusCode::UNAVAILABLE, "gone");
  std::atomic<int> asked = 0;
  std::atomic<int> watched = 0;
  FakeServer server;
  server.get_database = [&](auto&, const auto&, v1::GetDatabaseResponse& response) {
    response = *database;
    return asked++ == 0 ? grpc::Status::OK : gone;
  };
  server.watch_scenes = [&](grpc::ServerContext& context, const auto&,
                            grpc::ServerWriter<v1::WatchScenesResponse>& writer) {
    if (watched++ > 0) return gone;
    v1::WatchScenesResponse news;
    news.mutable_state()->set_database_generation(database->generation());
    v1::WatchedPath& path = *news.add_paths();
    path.set_id(1);
    for (const auto state : {v1::Verdict::STATE_FREE, v1::Verdict::STATE_OCCUPIED}) {
      path.mutable_answer()->mutable_check()->mutable_verdict()->set_state(state);
      writer.Write(news);
    }
    while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return gone;
  };
  const auto record =
      Start("silhouette-record " + server.address + " --folder r --format json", "record");
  EXPECT_TRUE(Has("record", "\"event\":\"stop\""));
  EXPECT_TRUE(Has("record", "\"event\":\"lost\""));
  ASSERT_EQ(record->End(SIGINT), 0);
  const auto recording = Recording::Open(Files("stop-").at(0));
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->summary().stops, SizeIs(1));
}

TEST_F(RecordProgram, WhatWasRecordedAndWhatIsLostIsReportedWhenItGivesUp) {
  const auto database = Client::Connect(cell_.address())->GetDatabase();
  ASSERT_TRUE(database.ok()) << database.status();
  std::atomic<bool> asked = false;
  FakeServer server;
  server.get_database = [&](auto&, const auto&, v1::GetDatabaseResponse& response) {
    response = *database;
    asked = true;
    return grpc::Status::OK;
  };
  server.watch_scenes = [&](grpc::ServerContext& context, const auto&,
                            grpc::ServerWriter<v1::WatchScenesResponse>& writer) {
    EXPECT_TRUE(fs::remove(cell_.shell().folder() / "r"));  // the disk takes nothing
    v1::WatchScenesResponse news;
    news.mutable_state()->set_database_generation(database->generation());
    writer.Write(news);
    while (!asked && !context.IsCancelled()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return grpc::Status(grpc::StatusCode::PERMISSION_DENIED, "no operator any more");
  };
  const auto record =
      Start("silhouette-record " + server.address + " --folder r --format json", "record");
  EXPECT_TRUE(Has("record", "no operator any more"));
  const std::string text = ContentOf(cell_.shell().folder() / "record");
  const size_t end = text.find("{\"event\":\"end\"");
  ASSERT_NE(end, std::string::npos) << text;
  EXPECT_GT(Json::parse(text.substr(end, text.find('\n', end) - end))["lost_messages"], 0) << text;
  EXPECT_EQ(record->End(SIGTERM), 3) << "the disk took not all of it";
}

TEST_F(RecordProgram, ReplayAnswersAsTheServerDidAndWhatAnotherPolicyWouldHaveSaid) {
  RecordAStop("");
  const std::string file = Files("recording-").at(0);
  const auto recording = Recording::Open(file);
  ASSERT_TRUE(recording.ok()) << recording.status();
  const std::string at_stop = absl::FormatTime(
      absl::RFC3339_full, (*recording)->summary().stops.at(0).time, absl::UTCTimeZone());
  // Another server, with the same database.
  const SmallServedCell other;
  const auto ask = [&](const std::string& arguments) {
    return Replay(file + " --to " + other.address() + " " + arguments);
  };
  const Ended before = ask("--at 0.1s --format json " + std::string(kPath));
  EXPECT_EQ(before.exit_code, 0) << before.out << before.err;
  EXPECT_EQ(Json::parse(before.out)["answers"][0]["state"], "free");

  const Ended then = ask("--at " + at_stop + " --format json");
  EXPECT_EQ(then.exit_code, 1) << then.err;
  const Json answer = Json::parse(then.out)["answers"].at(0);
  EXPECT_EQ(answer["then"], "occupied");
  EXPECT_EQ(answer["state"], "occupied");
  const Json recorded = Json::parse(ContentOf(cell_.shell().folder() / "stopped"));
  EXPECT_EQ(answer["configuration"], recorded["configuration"]);

  // Both views show the wall: no number of views makes the path free; below the wall it is.
  EXPECT_EQ(ask("--at " + at_stop + " --preset paper").exit_code, 1);
  EXPECT_EQ(ask("--at " + at_stop + " --preset paper 0,1 1,1").exit_code, 0);
  const Ended text = ask("--at " + at_stop + " --preset paper");
  EXPECT_THAT(text.out, AllOf(HasSubstr("scene 2"), HasSubstr("then occupied; not free at")));
}

// One of two views shows the wall: enough by default, not for who asks for two.
TEST_F(RecordProgram, ReplayAsksAsTheClientAskedThen) {
  Publish(kNothing);
  const auto record = Start("silhouette-record --folder r", "record");
  const auto watch =
      Start("silhouette watch --min-views 2 --format json " + std::string(kPath), "watch");
  ASSERT_TRUE(Has("watch", "\"scene_id\":1"));
  ASSERT_EQ(cell_.Publish(kWall, kNothing).exit_code, 0);
  ASSERT_TRUE(Has("watch", "\"scene_id\":2"));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ASSERT_EQ(record->End(SIGINT), 0);
  const std::string file = Files("recording-").at(0);
  const auto recording = Recording::Open(file);
  ASSERT_TRUE(recording.ok()) << recording.status();
  const std::string at = absl::FormatTime(absl::RFC3339_full, (*recording)->summary().scenes.back(),
                                          absl::UTCTimeZone());
  const SmallServedCell other;
  const auto ask = [&](const std::string& options) {
    return Replay(file + " --to " + other.address() + " --at " + at + options);
  };
  EXPECT_EQ(ask("").exit_code, 0) << ask("").out;
  EXPECT_EQ(ask(" --min-views 1").exit_code, 1);
}

TEST_F(RecordProgram, ReplayFeedsAServerWithTheSameScenes) {
  RecordAStop("");
  const SmallServedCell other;
  const Ended fed =
      Replay(Files("recording-").at(0) + " --speed 10 --format json --to " + other.address());
  ASSERT_EQ(fed.exit_code, 0) << fed.err;
  EXPECT_EQ(Json::parse(fed.out)["scenes"], 3);
  for (const std::string id : {"1", "2", "3"}) {
    const Json was = Json::parse(cell_.Run("scene show --format json --id " + id).out);
    const Json is = Json::parse(other.Run("scene show --format json --id " + id).out);
    EXPECT_EQ(is["views"].size(), 2u);
    for (size_t view = 0; view < 2; ++view) {
      for (const std::string what : {"foreground", "obstacle", "unknown", "error"}) {
        const std::string key = what + "_pixels";
        ASSERT_TRUE(was["views"][view].contains(key)) << was;
        EXPECT_EQ(is["views"][view][key], was["views"][view][key]) << id << key;
      }
    }
  }
}

TEST_F(RecordProgram, WhatIsLeftOfADamagedRecordingIsReplayedAndTheLossIsAFailure) {
  RecordAStop("");
  const std::string file = Files("recording-").at(0);
  std::string bytes = ContentOf(file);
  const size_t chunk = bytes.find("lz4");
  bytes.replace(chunk + 12, 8, 8, '\0');
  std::ofstream(file, std::ios::binary) << bytes;
  const Ended summary = Replay(file + " --format json");
  EXPECT_EQ(summary.exit_code, 3);
  EXPECT_THAT(summary.err, HasSubstr("silhouette: " + file + " is damaged at byte "));
  if (!summary.out.empty()) {
    EXPECT_THAT(std::string(Json::parse(summary.out)["damage"]), HasSubstr("lost is what was"));
  }
}

TEST_F(RecordProgram, SceneWithDefectsIsNeverFreeInAReplay) {
  Publish(kNothing);
  const auto record = Start("silhouette-record --folder r", "record");
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  // A view is missing.
  WriteMask(cell_.shell().folder() / "left.png", kNothing | RobotAt(0, 0));
  ASSERT_EQ(
      cell_.Run("scene publish --as mask --view left=left.png --joint x=0 --joint y=0").exit_code,
      1);
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  ASSERT_EQ(record->End(SIGTERM), 0);
  const std::string file = Files("recording-").at(0);
  const auto recording = Recording::Open(file);
  ASSERT_TRUE(recording.ok()) << recording.status();
  const RecordingSummary& summary = (*recording)->summary();
  ASSERT_THAT(summary.scenes, SizeIs(2));
  const SmallServedCell other;
  const Ended asked =
      Replay(file + " --format json 0,0 --to " + other.address() + " --at " +
             absl::FormatTime(absl::RFC3339_full, summary.end, absl::UTCTimeZone()));
  EXPECT_EQ(asked.exit_code, 1) << asked.err;
  EXPECT_EQ(Json::parse(asked.out)["answers"][0]["state"], "unknown");
  const Ended fed = Replay(file + " --format json --speed 10 --to " + other.address());
  EXPECT_EQ(Json::parse(fed.out)["without_joints"], 1) << fed.err;
  EXPECT_EQ(other.Run("check --format json 0,0").out.find("\"free\""), std::string::npos);
}

TEST_F(RecordProgram, ServerInUseIsRefused) {
  RecordAStop("");
  const absl::StatusOr<Client> client = Client::Connect(cell_.address());
  ASSERT_TRUE(client.ok());
  std::atomic<bool> end = false;
  std::thread publisher([&] {
    v1::PublishSceneRequest request;
    for (const std::string view : {"left", "right"}) {
      v1::ViewImage& image = *request.add_views();
      image.set_view(view);
      *image.mutable_scene_mask() = client::ToMessage(RobotAt(0, 0));
    }
    while (!end) {
      EXPECT_TRUE(client->PublishScene(request, client::RunningClock::now()).ok());
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  });
  const Ended ended = Replay(Files("recording-").at(0) + " --at 0.1s 0,0 --to " + cell_.address());
  end = true;
  publisher.join();
  EXPECT_EQ(ended.exit_code, 2);
  EXPECT_THAT(ended.err, HasSubstr("gets scenes from elsewhere"));
}

TEST_F(RecordProgram, KilledRecorderLeavesAFileThatIsRead) {
  Publish(kNothing);
  const auto record = Start("silhouette-record --folder r", "record");
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  Publish(kWall);
  std::this_thread::sleep_for(std::chrono::milliseconds(1300));
  record->End(SIGKILL);
  const auto recording = Recording::Open(Files("recording-").at(0));
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_TRUE((*recording)->summary().cut);
  EXPECT_THAT((*recording)->summary().scenes, SizeIs(2));
}

TEST_F(RecordProgram, LostServerIsToldOnceAndMistakesEndIt) {
  const auto record = Start("silhouette-record --folder r", "record");
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  cell_.StopServer();
  ASSERT_TRUE(Has("record", "trying again"));
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  const std::string text = ContentOf(cell_.shell().folder() / "record");
  EXPECT_EQ(text.find("trying again"), text.rfind("trying again")) << text;
  EXPECT_EQ(record->End(SIGINT), 0);
  for (const std::string arguments :
       {"", "--folder r --size 0", "--folder r --size 900kB", "--folder r --files 0",
        "--folder /proc/self", "--folder /dev/null/x", "nonsense --folder r"}) {
    const Ended ended = cell_.shell().Run(ProgramFolder() + "/silhouette-record " + arguments);
    EXPECT_EQ(ended.exit_code, 2) << arguments << ended.err;
    EXPECT_THAT(ended.err, ::testing::StartsWith("silhouette-record: ")) << arguments;
  }
  for (const std::string arguments :
       {"none.mcap", "cell.yaml", "cell.yaml --at 1s", "r/x.mcap 0,0"}) {
    EXPECT_EQ(Replay(arguments).exit_code, 2) << arguments;
  }
}

// The libraries that Foxglove reads it with, from npm.
TEST_F(RecordProgram, OpensWithTheFormatsOwnLibrary) {
  const std::string source = SourceFolder() + "/tests/tools/silhouette-record/";
  const std::string modules = BuildFolder() + "/tests/npm";
  const Shell& shell = cell_.shell();
  if (shell.Run("command -v npm node").exit_code != 0) GTEST_SKIP() << "npm is not installed";
  const Ended installed =
      shell.Run("mkdir -p " + modules + " && cd " + modules + " && cp " + source +
                "package.json . && npm install --no-audit --no-fund --silent");
  ASSERT_EQ(installed.exit_code, 0) << installed.err;
  RecordAStop("");
  const std::string file = Files("recording-").at(0);
  ASSERT_EQ(shell.Run("cp " + source + "read_recording.mjs " + modules).exit_code, 0);
  const Ended whole = shell.Run("node " + modules + "/read_recording.mjs " + file);
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  const Json read = Json::parse(whole.out);
  EXPECT_EQ(read["library"], "silhouette");
  EXPECT_EQ(read["cell"], "block");
  ASSERT_THAT(read["scenes"], SizeIs(3));
  const Json& scene = read["scenes"][1];
  EXPECT_EQ(scene["id"], 2);
  EXPECT_EQ(scene["joints"][1]["name"], "y");
  EXPECT_EQ(scene["views"][0]["scene"]["width"], 16);
  EXPECT_EQ(scene["views"][0]["obstacle_pixels"], kWall.Count());
  Json paths = read["paths"];
  if (paths.back() == "ended") paths.erase(paths.size() - 1);  // unless the recorder ended first
  EXPECT_EQ(paths, Json({"STATE_FREE", "STATE_OCCUPIED", "STATE_FREE"}));
  int count = 0;
  for (const auto& [topic, messages] : read["topics"].items()) count += messages.get<int>();
  EXPECT_EQ(read["count"], count);

  const std::string cut = shell.folder() / "cut.mcap";
  fs::copy_file(file, cut);
  fs::resize_file(cut, fs::file_size(cut) - 5);
  const Ended of_cut = shell.Run("node " + modules + "/read_recording.mjs " + cut + " --cut");
  ASSERT_EQ(of_cut.exit_code, 0) << of_cut.err;
  EXPECT_THAT(Json::parse(of_cut.out)["scenes"], SizeIs(3));
}

}  // namespace
}  // namespace silhouette
