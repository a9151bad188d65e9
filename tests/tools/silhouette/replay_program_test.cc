// SPDX-License-Identifier: Apache-2.0
// `silhouette replay` against the real server, with recordings that are made here.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "common/recording/recorder.h"
#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "tests/tools/silhouette/small_served_cell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;

const absl::Time kRecorded = absl::FromUnixSeconds(1'769'860'800);
constexpr char kAtItsBeginning[] = " --at 2026-01-31T12:00:00Z 0,0";

class ReplayProgram : public testing::Test {
 protected:
  // The robot at (0, 0), and nothing else.
  static v1::Scene EmptyScene() {
    v1::Scene scene;
    for (const char* joint : {"x", "y"}) scene.add_joints()->set_name(joint);
    for (const char* name : {"left", "right"}) {
      v1::SceneView& view = *scene.add_views();
      view.set_view(name);
      *view.mutable_scene() = client::ToMessage(RobotAt(0, 0));
    }
    return scene;
  }
  v1::GetDatabaseResponse Database() const {
    return Client::Connect(cell_.address())->GetDatabase().value();
  }
  // One scene a second, each in a chunk of its own. Returns the file.
  static std::string Record(const v1::GetDatabaseResponse& database,
                            const std::vector<v1::Scene>& scenes) {
    Recorder recorder({.folder = FreshFolder().string()}, database);
    absl::Duration passed;
    for (const v1::Scene& scene : scenes) {
      v1::WatchScenesResponse news;
      news.mutable_state()->set_database_generation(database.generation());
      *news.mutable_scene() = scene;
      *news.mutable_scene()->mutable_time() = client::ToMessage(kRecorded + passed);
      recorder.Take(news, {.wall = kRecorded + passed, .running = passed});
      EXPECT_TRUE(recorder.Flush().ok());
      passed += absl::Seconds(1);
    }
    EXPECT_TRUE(recorder.Close().ok());
    return recorder.path();
  }
  // To the cell's own server.
  Ended Replay(const std::string& file, const std::string& arguments) const {
    return cell_.Run("replay " + file + " --to " + cell_.address() + arguments);
  }

  const SmallServedCell cell_;
};

TEST_F(ReplayProgram, AnotherGridOfTheSameCellIsRefused) {
  v1::GetDatabaseResponse other = Database();
  other.set_cell_digest(other.cell_digest() + 1);
  const std::string file = Record(other, {EmptyScene()});
  for (const std::string arguments : {"", kAtItsBeginning}) {
    const Ended ended = Replay(file, arguments);
    EXPECT_EQ(ended.exit_code, 2) << ended.out;
    EXPECT_THAT(ended.err, HasSubstr("the recording is of another cell or grid"));
  }
}

TEST_F(ReplayProgram, EndsWithCtrlCAsStopped) {
  const std::string file = Record(Database(), {EmptyScene(), EmptyScene()});
  Process replay(
      {ProgramFolder() + "/silhouette", "replay", file, "--to", cell_.address(), "--speed", "0.01"},
      cell_.shell().folder() / "replay.txt");
  for (int i = 0; i < 500 && cell_.Run("scene show").exit_code != 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(replay.End(SIGINT), 130);
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "replay.txt"), HasSubstr("1 scenes published"));
}

TEST_F(ReplayProgram, ADefectWithoutAMessageIsADefect) {
  for (const auto& [reason, said] : {std::pair(v1::Verdict::REASON_SCENE_SKEWED, "scene skewed"),
                                     {v1::Verdict::REASON_UNSPECIFIED, "a defect"}}) {
    v1::Scene scene = EmptyScene();
    scene.add_defects()->set_reason(reason);
    const Ended ended =
        Replay(Record(Database(), {scene}), std::string(" --format json") + kAtItsBeginning);
    EXPECT_EQ(ended.exit_code, 1) << ended.err;
    const Json answer = Json::parse(ended.out)["answers"].at(0);
    EXPECT_EQ(answer["state"], "unknown");
    EXPECT_EQ(answer["message"], said);
  }
}

TEST_F(ReplayProgram, FreeOfADamagedRecordingIsAFailure) {
  const std::string file = Record(Database(), {EmptyScene(), EmptyScene(), EmptyScene()});
  EXPECT_EQ(Replay(file, kAtItsBeginning).exit_code, 0);
  std::string bytes = ContentOf(file);
  const size_t second = bytes.find("lz4", bytes.find("lz4") + 1);
  bytes.replace(second + 10, 20, 20, '\0');
  std::ofstream(file, std::ios::binary) << bytes;
  const Ended ended = Replay(file, kAtItsBeginning);
  EXPECT_EQ(ended.exit_code, 3);
  EXPECT_THAT(ended.out, HasSubstr("free"));
  EXPECT_THAT(ended.err, HasSubstr("is damaged at byte "));
}

TEST_F(ReplayProgram, OptionsThatDoNothingAreRefused) {
  const std::string file = Record(Database(), {EmptyScene()});
  const std::string to = " --to " + cell_.address();
  for (const std::string option : {"--preset paper", "--min-views 1", "--max-occluded-views 0",
                                   "--off-grid cell", "--variant default", "--degrees"}) {
    for (const std::string& arguments : {" " + option, to + " " + option}) {
      const Ended ended = cell_.Run("replay " + file + arguments);
      EXPECT_EQ(ended.exit_code, 2) << arguments << ended.out;
      EXPECT_THAT(ended.err, HasSubstr(option.substr(0, option.find(' ')))) << arguments;
      EXPECT_THAT(ended.err, HasSubstr("--at")) << arguments;
    }
  }
  EXPECT_THAT(cell_.Run("replay " + file + " --speed 2").err, HasSubstr("--to"));
  EXPECT_THAT(Replay(file, " --speed 2" + std::string(kAtItsBeginning)).err, HasSubstr("--speed"));
}

}  // namespace
}  // namespace silhouette
