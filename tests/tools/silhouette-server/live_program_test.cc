// SPDX-License-Identifier: Apache-2.0
// silhouette-server --live on a simulated cell, as a user runs it.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"
#include "tests/running_program.h"
#include "tests/server/live/http_get.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// One cell for all tests: capturing it takes longer than they do.
struct LiveProgramTest : ::testing::Test {
  static void SetUpTestSuite() {
    cell = new ProgramCell;
    cell->WriteCell(
        {{"capture:\n", "server: {max_age: 20 s, live: {joints_gap: 10 s}}\ncapture:\n"}});
    cell->CaptureAll();
  }
  static void TearDownTestSuite() {
    delete cell;
    cell = nullptr;
  }
  // Starts the server and waits for its address.
  void Start(const std::string& more) {
    StartOnly(more);
    address = server->Address();
  }
  void StartOnly(const std::string& more, const std::string& file = cell->cell()) {
    const std::string command =
        absl::StrCat("exec '", ProgramFolder(), "/silhouette-server' --cell '", file,
                     "' --database '", database, "' --listen 127.0.0.1:0 ", more);
    server.emplace(std::vector<std::string>{"/bin/sh", "-c", command}, *cell / "server.out",
                   *cell / "server.err");
  }
  std::string Log() const { return server->Errors(); }
  // What the log of a live server with this source of the view 'top' has.
  std::string LogWith(const std::string& source, const std::string& max_age) {
    const std::string file = *cell / "source.yaml";
    WriteText(file,
              absl::StrReplaceAll(ReadText(cell->cell()),
                                  {{"max_age: 20 s", "max_age: " + max_age},
                                   {"name: top, source: sim", "name: top, source: " + source}}));
    StartOnly("--live", file);
    server->Address();
    EXPECT_EQ(server->End(SIGTERM), 0);
    return Log();
  }

  // The file's text, once it has `part`.
  std::string AwaitText(const std::string& file, const std::string& part) const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    for (;;) {
      const std::string text = ReadText(file);
      if (text.find(part) != std::string::npos) return text;
      if (std::chrono::steady_clock::now() > end) {
        ADD_FAILURE() << "no '" << part << "' in " << text << Log();
        return std::string(20, ' ') + "\n";
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  Outcome Ask(const std::string& arguments) const {
    const std::string command =
        absl::StrCat("'", ProgramFolder(), "/silhouette' --timeout 60 --server ", address, " ",
                     arguments, " >'", *cell / "client.out", "' 2>'", *cell / "client.err", "'");
    const int status = std::system(command.c_str());
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            .out = ReadText(*cell / "client.out"),
            .err = ReadText(*cell / "client.err")};
  }
  // The acquisition's status, once `is` holds of it.
  Json AwaitStatus(const std::function<bool(const Json&)>& is) const {
    Json status;
    for (int i = 0; i < 600; ++i) {
      status = Json::parse(Ask("scene live --format json").out, nullptr, false);
      if (!status.is_discarded() && is(status)) return status;
    }
    ADD_FAILURE() << "it never came: " << status.dump(1) << Log();
    return status;
  }

  static ProgramCell* cell;
  std::optional<RunningProgram> server;
  std::string database = cell->database();
  std::string address;
};

ProgramCell* LiveProgramTest::cell = nullptr;

TEST_F(LiveProgramTest, ScenesOfItsOwnImagesMakeVerdicts) {
  Start("--live --metrics 127.0.0.1:0");
  const Json status = AwaitStatus([](const Json& now) {
    return now["serving"] == true && now["scenes"] > 1 && now["to_map"]["count"] > 1;
  });
  EXPECT_EQ(status["cameras"].size(), 2u);
  EXPECT_EQ(status["cameras"][0]["view"], "top");
  EXPECT_GT(status["robot"]["samples"], 0);
  EXPECT_GT(status["to_map"]["median_ms"], 0);
  const Json space = Json::parse(Ask("space --format json").out, nullptr, false);
  EXPECT_GT(space["free"], 0);
  EXPECT_EQ(space["unknown"], 0) << space.dump();
  const std::string text = Ask("scene live").out;
  EXPECT_THAT(text, AllOf(HasSubstr("camera front"), HasSubstr("to the map:   median")));

  const std::string log = AwaitText(*cell / "server.err", "metrics at http://");
  const std::string metrics = log.substr(log.find("http://") + 7);
  EXPECT_THAT(HttpGet(metrics.substr(0, metrics.find('/')), "/metrics"),
              HasSubstr("silhouette_live_images_total{view=\"front\"}"));

  EXPECT_EQ(server->End(SIGTERM), 0);
  EXPECT_THAT(Log(), AllOf(HasSubstr("acquisition stopped: "), HasSubstr("to the map: median")));
}

TEST_F(LiveProgramTest, ObstaclesInTheSimulatedCellAreSeen) {
  WriteText(*cell / "obstacles.yaml",
            "obstacles:\n  - {name: ball, sphere: {radius: 0.3}, position: [0.9, 0.5, 1.2],\n"
            "     brightness: 0.9}\n");
  Start("--live --simulated-obstacles '" + (*cell / "obstacles.yaml") + "'");
  AwaitStatus([](const Json& now) { return now["serving"] == true && now["scenes"] > 1; });
  const Json scene = Json::parse(Ask("scene show --format json").out, nullptr, false);
  EXPECT_GT(scene["views"][0]["obstacle_pixels"], 0) << scene.dump(1);
  EXPECT_EQ(server->End(SIGINT), 0);
}

TEST_F(LiveProgramTest, MistakesAreToldInOneSentence) {
  WriteText(*cell / "bare.yaml",
            absl::StrReplaceAll(ReadText(cell->cell()), {{"  driver: sim\n", ""}}));
  const auto refused = [&](const std::string& more, const std::string& file = cell->cell()) {
    StartOnly(more, file);
    EXPECT_EQ(server->ExitCode(), 2) << Log();
    return Log();
  };
  EXPECT_THAT(refused("--live", *cell / "bare.yaml"), HasSubstr("put 'driver: sim'"));
  WriteText(*cell / "typed.yaml", absl::StrReplaceAll(ReadText(cell->cell()),
                                                      {{"  driver: sim\n", "  driver: manual\n"}}));
  EXPECT_THAT(refused("--live", *cell / "typed.yaml"),
              HasSubstr("'manual' only asks people for them: give it 'read'"));
  EXPECT_THAT(refused("--simulated-obstacles x.yaml"), HasSubstr("--live"));
  EXPECT_THAT(refused("--live --simulated-obstacles x.yaml"), HasSubstr("x.yaml"));
  EXPECT_THAT(refused("--live --metrics nowhere"), HasSubstr("127.0.0.1"));
}

TEST_F(LiveProgramTest, LatencyThatMakesScenesStaleIsToldAtTheStart) {
  const auto log_with = [&](const std::string& max_age) {
    return LogWith("{rtsp: {url: 'rtsp://127.0.0.1:9/', latency: 300 ms}}", max_age);
  };
  EXPECT_THAT(log_with("500 ms"),
              HasSubstr("view 'top': with --live and a latency of 300 ms a scene is more "
                        "than 600 ms old before the next one comes"));
  EXPECT_THAT(log_with("2 s"), Not(HasSubstr("latency")));
}

TEST_F(LiveProgramTest, TimeoutThatMakesScenesStaleIsToldAtTheStart) {
  EXPECT_THAT(
      LogWith("{rtsp: 'rtsp://127.0.0.1:9/'}", "5 s"),
      HasSubstr(
          "view 'top': with --live a silent camera delays all views by its timeout, 5 s, and the "
          "whole cell is unknown"));
  EXPECT_THAT(
      LogWith("{rtsp: {url: 'rtsp://127.0.0.1:9/', latency: 100 ms, timeout: 400 ms}}", "5 s"),
      Not(HasSubstr("silent camera")));
}

TEST_F(LiveProgramTest, CallsHaveTheirGraceAndTheEndIsRecordedThoughACameraIsSilent) {
  // It takes connections, and never answers.
  const int silent = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  ASSERT_EQ(bind(silent, reinterpret_cast<sockaddr*>(&at), size), 0);
  ASSERT_EQ(listen(silent, 16), 0);
  ASSERT_EQ(getsockname(silent, reinterpret_cast<sockaddr*>(&at), &size), 0);
  const std::string source =
      absl::StrCat("{grpc: {address: '127.0.0.1:", ntohs(at.sin_port), "', timeout: 8 s}}");
  const std::string file = *cell / "silent.yaml";
  WriteText(file,
            absl::StrReplaceAll(ReadText(cell->cell()),
                                {{"max_age: 20 s", "max_age: 20 s, audit: silent.jsonl"},
                                 {"name: top, source: sim", "name: top, source: " + source}}));
  StartOnly("--live", file);
  server->Address();
  const int ended = server->End(SIGTERM);
  EXPECT_TRUE(ended == 3 || ended == 0) << ended;  // 0: between two tries to reach the camera
  EXPECT_THAT(ReadText(*cell / "silent.jsonl"), HasSubstr("server.stop"));
  close(silent);
}

TEST_F(LiveProgramTest, RecordingIsToldAtTheStart) {
  std::filesystem::create_directory(*cell / "images");
  WriteText(*cell / "images/1.pgm", "P5\n160 120\n255\n" + std::string(160 * 120, 'x'));
  EXPECT_THAT(
      LogWith("{folder: {path: images, repeat: true}}", "20 s"),
      HasSubstr("view 'top' is a recording: verdicts say nothing of the cell as it is now"));
}

TEST_F(LiveProgramTest, SimulatedRobotWithOtherCamerasIsToldAtTheStart) {
  const std::string said = "is not simulated, but the robot is";
  EXPECT_THAT(LogWith("{rtsp: 'rtsp://127.0.0.1:9/'}", "20 s"), HasSubstr("view 'top' " + said));
  EXPECT_THAT(LogWith("sim", "20 s"), Not(HasSubstr(said)));
}

TEST_F(LiveProgramTest, TheVariantIsToldByTheProgram) {
  database = *cell / "two.lmdb";
  std::filesystem::copy(cell->database(), database, std::filesystem::copy_options::recursive);
  const Outcome captured =
      cell->Run({"run", "--cell", cell->cell(), "--database", database, "--variant", "same"});
  ASSERT_EQ(captured.exit_code, 0) << captured.err;
  Start("--live");
  const Json before = AwaitStatus([](const Json& now) { return now["scenes"] > 0; });
  EXPECT_EQ(before["robot_variant"]["variant"], nullptr);
  EXPECT_EQ(Ask("check 0,0").exit_code, 1);
  EXPECT_THAT(Ask("scene show").out, HasSubstr("the robot's variant is not known"));

  const Json changing =
      Json::parse(Ask("scene variant --changing --format json").out, nullptr, false);
  EXPECT_EQ(changing["changing"], true);
  EXPECT_THAT(Ask("scene live").out, HasSubstr("not free: the robot's variant"));
  EXPECT_THAT(Ask("scene variant same").out,
              HasSubstr("the robot has the variant same, in scenes after "));
  AwaitStatus([](const Json& now) { return now["robot_variant"]["variant"] == "same"; });
  Json scene;
  for (int i = 0; i < 600 && scene["variant"] != "same"; ++i) {
    scene = Json::parse(Ask("scene show --format json").out, nullptr, false);
  }
  EXPECT_EQ(scene["variant"], "same");
  EXPECT_GT(Json::parse(Ask("space --format json").out, nullptr, false)["free"], 0);

  EXPECT_EQ(Ask("scene variant").exit_code, 2);
  const Outcome unknown = Ask("scene variant none");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("its variants are default, same"));
  EXPECT_EQ(server->End(SIGTERM), 0);
  EXPECT_THAT(Log(), HasSubstr("reports that the robot's variant is 'same'"));
}

TEST_F(LiveProgramTest, WithoutLiveThereIsNoAcquisition) {
  Start("");
  const Outcome status = Ask("scene live");
  EXPECT_EQ(status.exit_code, 2);
  EXPECT_THAT(status.err, HasSubstr("start it with --live"));
}

}  // namespace
}  // namespace silhouette
