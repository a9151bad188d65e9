// SPDX-License-Identifier: Apache-2.0
// `silhouette watch` and `silhouette check --stream` against the real server, as a user runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <future>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>

#include "silhouette/messages.h"
#include "tests/clients/cpp/fake_server.h"
#include "tests/folders.h"
#include "tests/tools/silhouette/small_served_cell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

std::vector<Json> LinesOf(const std::string& text) {
  std::vector<Json> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(Json::parse(line));
  return lines;
}

class SilhouetteWatch : public testing::Test {
 protected:
  SmallServedCell cell_;

  void Publish(const Mask& obstacle) {
    const Ended ended = cell_.Publish(obstacle, obstacle);
    ASSERT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  }

  // silhouette with these arguments in the background, its output in this file of the cell's
  // folder.
  std::unique_ptr<Process> Start(const std::string& arguments, const std::string& output) const {
    const std::string command = "exec env SILHOUETTE_SERVER=" + cell_.address() + " " +
                                ProgramFolder() + "/silhouette " + arguments;
    return std::make_unique<Process>(std::vector<std::string>{"/bin/sh", "-c", command},
                                     cell_.shell().folder() / output);
  }

  // Whether a file of the cell's folder has that many lines within ten seconds.
  bool HasLines(const std::string& file, long count) const {
    for (int i = 0; i < 500; ++i) {
      const std::string text = ContentOf(cell_.shell().folder() / file);
      if (std::count(text.begin(), text.end(), '\n') >= count) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }
};

TEST_F(SilhouetteWatch, TellsTheSpaceWithEveryScene) {
  const auto watch = Start("watch --max-age 10min --format json", "watch.json");
  ASSERT_TRUE(HasLines("watch.json", 1));
  Publish(kNothing);
  ASSERT_TRUE(HasLines("watch.json", 2));
  Publish(kWall);
  ASSERT_TRUE(HasLines("watch.json", 3));
  watch->Stop();
  const std::vector<Json> lines = LinesOf(ContentOf(cell_.shell().folder() / "watch.json"));
  ASSERT_THAT(lines, SizeIs(3));
  EXPECT_EQ(lines[0]["unknown_reason"], "no scene");
  EXPECT_EQ(lines[0]["unknown"], 121);
  EXPECT_EQ(lines[1]["scene_id"], 1);
  EXPECT_EQ(lines[1]["free"], 121);
  EXPECT_EQ(lines[1]["unknown_reason"], Json());
  EXPECT_EQ(lines[2]["scene_id"], 2);
  EXPECT_EQ(lines[2]["tiles_changed"], 1);
  EXPECT_EQ(lines[2]["skipped_scenes"], 0);
  const Json space = Json::parse(cell_.Run("space --format json").out);
  EXPECT_GT(lines[2]["occupied"], 0);
  EXPECT_EQ(lines[2]["free"], space["free"]);
  EXPECT_EQ(lines[2]["occupied"], space["occupied"]);
}

TEST_F(SilhouetteWatch, TellsAPathWithEveryScene) {
  Publish(kNothing);
  const Ended text = cell_.Run("watch 0,0 1,0 --count 1");
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out,
              AllOf(StartsWith("scene 1, "), HasSubstr("free"), HasSubstr(": 21 places checked")));
  const auto watch = Start("watch 0,0 1,0 --format json --clearance", "watch.json");
  ASSERT_TRUE(HasLines("watch.json", 1));
  Publish(kWall);
  ASSERT_TRUE(HasLines("watch.json", 2));
  watch->Stop();
  const std::vector<Json> lines = LinesOf(ContentOf(cell_.shell().folder() / "watch.json"));
  EXPECT_EQ(lines.at(0)["state"], "free");
  EXPECT_TRUE(lines[0].contains("clearance"));
  EXPECT_EQ(lines.at(1)["state"], "occupied");
  EXPECT_EQ(lines[1]["scene_id"], 2);
  EXPECT_TRUE(lines[1].contains("configuration"));
}

TEST_F(SilhouetteWatch, SaysWhenTheSceneBecomesTooOld) {
  Publish(kNothing);
  const auto watch = Start("watch --max-age 400ms", "watch.txt");
  // A scene that was published before may be too old at once.
  ASSERT_TRUE(HasLines("watch.txt", 1));
  Publish(kNothing);
  ASSERT_TRUE(HasLines("watch.txt", 3));
  watch->Stop();
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "watch.txt"),
              AllOf(HasSubstr("121 free"), HasSubstr("all unknown: the scene of the last update is "
                                                     "older than max_age")));
}

// Sends one update for a path: free. `valid_for`: seconds.
void AnswerPaths(FakeServer& server, int valid_for) {
  const auto set = [valid_for](v1::Basis& basis) {
    basis.set_scene_id(3);
    basis.mutable_scene_age()->set_seconds(1);
    basis.mutable_valid_for()->set_seconds(valid_for);
    *basis.mutable_server_clock() =
        client::ToMessage(absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch()));
  };
  server.check_configurations = [set](auto&, const auto&, auto& response) {
    set(*response.mutable_basis());
    return grpc::Status::OK;
  };
  server.watch_path = [set](auto& context, const auto&, auto& writer) {
    v1::WatchPathResponse update;
    v1::CheckPathResponse& check = *update.mutable_check();
    set(*check.mutable_basis());
    check.mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
    check.mutable_separation()->set_level(2);
    check.mutable_separation()->set_level_name("fast");
    writer.Write(update);
    while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return grpc::Status::OK;
  };
}

TEST_F(SilhouetteWatch, PathIsUnknownOnceItsLastUpdateExpires) {
  FakeServer server;
  AnswerPaths(server, /*valid_for=*/5);
  const auto watch = Start("--server " + server.address + " watch 0,0 1,0", "watch.txt");
  EXPECT_TRUE(HasLines("watch.txt", 2));
  watch->Stop();
  EXPECT_THAT(
      ContentOf(cell_.shell().folder() / "watch.txt"),
      ContainsRegex("free[^\n]*\n[^\n]*: unknown: the last update of the server has expired"));
}

TEST_F(SilhouetteWatch, UpdateThatHasExpiredOnItsWayIsNeverFreeAndHasNoLevel) {
  FakeServer server;
  AnswerPaths(server, /*valid_for=*/0);
  const auto run = [&](const std::string& format) {
    const Ended ended =
        cell_.Run("--server " + server.address + " watch 0,0 1,0 --separation --count 1" + format);
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    return ended.out;
  };
  EXPECT_THAT(run(""),
              AllOf(HasSubstr("unknown: the last update of the server has expired"),
                    HasSubstr("; stop: "), Not(HasSubstr("free")), Not(HasSubstr("fast"))));
  const Json json = Json::parse(run(" --format json"));
  EXPECT_EQ(json["state"], "unknown");
  EXPECT_EQ(json["separation"]["level"], 0);
}

TEST_F(SilhouetteWatch, PathIsWatchedWithTheResolutionThatIsAskedFor) {
  FakeServer server;
  AnswerPaths(server, /*valid_for=*/60);
  std::atomic<double> asked = 0;
  server.watch_path = [&, answer = server.watch_path](auto& context, const auto& request,
                                                      auto& writer) {
    asked = request.path_resolution();
    return answer(context, request, writer);
  };
  const Ended ended =
      cell_.Run("--server " + server.address + " watch 0,0 1,0 --count 1 --resolution 0.001");
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(asked, 0.001);
}

TEST_F(SilhouetteWatch, PathThatALimitRefusesIsNotCalledALostConnection) {
  FakeServer server;
  server.watch_path = [](auto&, const auto&, auto&) {
    return grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "beyond 'streams_per_client'");
  };
  const auto watch = Start("--server " + server.address + " watch 0,0 1,0", "watch.txt");
  EXPECT_TRUE(HasLines("watch.txt", 1));
  watch->Stop();
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "watch.txt"),
              AllOf(HasSubstr("the server refuses"), HasSubstr("'streams_per_client'"),
                    Not(HasSubstr("no connection"))));
}

TEST_F(SilhouetteWatch, LateAnswerIsUnknownWithItsReason) {
  FakeServer server;
  server.check_configurations = [](auto&, const auto& request, auto& response) {
    response.mutable_basis()->set_scene_id(3);
    response.mutable_basis()->mutable_valid_for()->set_nanos(200'000'000);
    *response.mutable_basis()->mutable_server_clock() =
        client::ToMessage(absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch()));
    if (request.configurations_size() == 0) return grpc::Status::OK;
    response.add_verdicts()->set_state(v1::Verdict::STATE_FREE);
    std::this_thread::sleep_for(std::chrono::milliseconds(800));
    return grpc::Status::OK;
  };
  const Ended check = cell_.Run("--server " + server.address + " check 0,0");
  EXPECT_EQ(check.exit_code, 1) << check.err;
  EXPECT_THAT(check.out,
              AllOf(ContainsRegex(
                        "0,0: unknown: the answer was valid for 0.20 s and came after [0-9.]+ s:"),
                    Not(HasSubstr("free"))));
}

TEST_F(SilhouetteWatch, EndsCleanlyWithCtrlC) {
  Publish(kNothing);
  const std::map<std::string, std::string> arguments = {{"space.txt", "watch"},
                                                        {"path.txt", "watch 0,0 1,0"}};
  for (const auto& [output, what] : arguments) {
    const auto program = Start(what, output);
    ASSERT_TRUE(HasLines(output, 1)) << what;
    const std::string before = ContentOf(cell_.shell().folder() / output);
    EXPECT_EQ(program->End(SIGINT), 0) << what;
    EXPECT_EQ(ContentOf(cell_.shell().folder() / output), before) << what;
  }
}

TEST_F(SilhouetteWatch, StreamedChecksThatASignalEndsAreStoppedAndNotAllFree) {
  Publish(kNothing);
  const std::string questions = cell_.shell().folder() / "questions";
  ASSERT_EQ(mkfifo(questions.c_str(), 0600), 0);
  // Open for reading, too: opening then does not block, and the program's input does not end.
  const int asked = open(questions.c_str(), O_RDWR);
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string output = "checks" + std::to_string(signal) + ".txt";
    ASSERT_EQ(write(asked, "0,0\n", 4), 4);
    const auto program = Start("check --stream <" + questions, output);
    ASSERT_TRUE(HasLines(output, 1));
    EXPECT_EQ(program->End(signal), 130);
    EXPECT_THAT(ContentOf(cell_.shell().folder() / output), MatchesRegex("0,0: free[^\n]*\n"));
  }
  close(asked);
}

TEST_F(SilhouetteWatch, StreamedChecksEndWithCtrlCWhileAnAnswerIsOutstanding) {
  FakeServer server;
  server.check_configurations = [](auto&, const auto&, auto& response) {
    *response.mutable_basis()->mutable_server_clock() =
        client::ToMessage(absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch()));
    return grpc::Status::OK;
  };
  std::promise<void> asked;
  std::atomic<bool> over = false;
  server.stream_checks = [&](auto& context, auto& stream) {
    v1::StreamChecksRequest question;
    if (stream.Read(&question)) asked.set_value();
    while (!over && !context.IsCancelled()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return grpc::Status::OK;
  };
  const std::filesystem::path questions = cell_.shell().folder() / "questions.txt";
  WriteFile(questions, "0,0\n");
  const auto check =
      Start("--server " + server.address + " check --stream <" + questions.string(), "checks.txt");
  ASSERT_EQ(asked.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready)
      << ContentOf(cell_.shell().folder() / "checks.txt");
  std::future<int> code = std::async(std::launch::async, [&] { return check->End(SIGINT); });
  EXPECT_EQ(code.wait_for(std::chrono::seconds(5)), std::future_status::ready);
  over = true;
  EXPECT_EQ(code.get(), 130);
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "checks.txt"), IsEmpty());
}

TEST_F(SilhouetteWatch, PlanThatCtrlCEndsHasAnExitCodeOfItsOwn) {
  FakeServer server;
  const auto basis = [](v1::Basis& of) {
    of.set_scene_id(3);
    of.mutable_valid_for()->set_seconds(60);
    *of.mutable_server_clock() =
        client::ToMessage(absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch()));
  };
  server.get_database = [](auto&, const auto&, auto& response) {
    response.set_images("drawn");
    response.mutable_grid()->add_tile_edges(4096);
    v1::GridJoint& joint = *response.mutable_grid()->add_joints();
    joint.set_name("x");
    joint.set_upper(1);
    joint.set_steps(2);
    return grpc::Status::OK;
  };
  server.check_configurations = [&](auto&, const auto& request, auto& response) {
    basis(*response.mutable_basis());
    for (int i = 0; i < request.configurations_size(); ++i) {
      response.add_verdicts()->set_state(v1::Verdict::STATE_FREE);
    }
    return grpc::Status::OK;
  };
  std::promise<void> searches;
  std::promise<void> stopped;
  server.check_path = [&](auto&, const auto&, auto& response) {
    static bool first = true;
    if (std::exchange(first, false)) {
      searches.set_value();
      stopped.get_future().wait();
    }
    basis(*response.mutable_basis());
    response.mutable_verdict()->set_state(v1::Verdict::STATE_OCCUPIED);
    return grpc::Status::OK;
  };
  const std::filesystem::path path = cell_.shell().folder() / "path.json";
  WriteFile(path, R"({"waypoints": [[0]]})");
  const auto plan =
      Start("--server " + server.address + " plan 0 1 --out " + path.string(), "plan.txt");
  ASSERT_EQ(searches.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready)
      << ContentOf(cell_.shell().folder() / "plan.txt");
  EXPECT_EQ(Json::parse(ContentOf(path))["waypoints"], Json::array()) << "as a kill leaves it";
  std::future<int> code = std::async(std::launch::async, [&] { return plan->End(SIGINT); });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  stopped.set_value();
  EXPECT_EQ(code.get(), 130);
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "plan.txt"), HasSubstr("stopped"));
}

TEST_F(SilhouetteWatch, LostServerIsToldAndTriedAgainOrEndsIt) {
  Publish(kNothing);
  for (const std::string path : {"", "0,0 1,0 "}) {
    const auto goes_on = Start("watch " + path + "--format json", "on.json");
    ASSERT_TRUE(HasLines("on.json", 1));
    goes_on->Stop();
  }
  const auto space = Start("watch --max-age 10min --format json", "space.json");
  const auto path = Start("watch 0,0 1,0 --format json", "path.json");
  ASSERT_TRUE(HasLines("space.json", 1) && HasLines("path.json", 1));
  cell_.StopServer();
  ASSERT_TRUE(HasLines("space.json", 2) && HasLines("path.json", 2));
  EXPECT_TRUE(space->Running() && path->Running());
  const Json lost = LinesOf(ContentOf(cell_.shell().folder() / "space.json")).at(1);
  EXPECT_EQ(lost["unknown_reason"], "connection lost");
  EXPECT_EQ(lost["free"], 0);
  EXPECT_EQ(LinesOf(ContentOf(cell_.shell().folder() / "path.json")).at(1)["reason"],
            "connection lost");
  for (const std::string what : {"watch --no-retry", "watch 0,0 1,0 --no-retry"}) {
    const Ended ended = cell_.Run(what);
    EXPECT_EQ(ended.exit_code, 3) << what;
    EXPECT_THAT(ended.err, HasSubstr("no server answers at " + cell_.address())) << what;
  }
}

TEST_F(SilhouetteWatch, PathThatNeedsTheDatabaseWaitsForTheServer) {
  const std::filesystem::path file = cell_.shell().folder() / "path.json";
  WriteFile(file, R"({"joints": ["x"], "waypoints": [[0], [1]]})");
  FakeServer server;
  server.Stop();
  const std::string at_server = "--server " + server.address + " watch ";
  const std::vector<std::string> paths = {"--file " + file.string(), "--degrees 0 10"};
  for (size_t i = 0; i < paths.size(); ++i) {
    const std::string output = "watch" + std::to_string(i);
    const auto watch = Start(at_server + paths[i], output);
    ASSERT_TRUE(HasLines(output, 1)) << paths[i];
    EXPECT_THAT(ContentOf(cell_.shell().folder() / output), HasSubstr("no server answers"));
    EXPECT_TRUE(watch->Running()) << paths[i];
    EXPECT_EQ(watch->End(SIGINT), 0) << paths[i];
    EXPECT_EQ(cell_.Run(at_server + paths[i] + " --no-retry").exit_code, 3) << paths[i];
  }
  const auto watch = Start(at_server + paths[0], "watch.txt");
  ASSERT_TRUE(HasLines("watch.txt", 1));
  FakeServer later(server.address);
  AnswerPaths(later, /*valid_for=*/60);
  later.get_database = [](auto&, const auto&, auto& response) {
    v1::GridJoint& joint = *response.mutable_grid()->add_joints();
    joint.set_name("x");
    joint.set_upper(1);
    joint.set_steps(11);
    response.mutable_grid()->add_tile_edges(4096);
    return grpc::Status::OK;
  };
  EXPECT_TRUE(HasLines("watch.txt", 2));
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "watch.txt"), ContainsRegex("\n[^\n]*: free"));
}

TEST_F(SilhouetteWatch, MistakeOfTheUserEndsItAtOnce) {
  for (const std::string what :
       {"watch --preset calibrated", "watch 0,0 1,0 --preset calibrated", "watch 0,0 1",
        "watch --max-age long", "watch --max-age 0s", "watch --count 0",
        "watch 0,0 --file path.json", "watch 0,0 1,0 --max-age 300ms", "watch --separation",
        "watch --clearance", "watch --resolution 0.001"}) {
    const Ended ended = cell_.Run(what);
    EXPECT_EQ(ended.exit_code, 2) << what << ": " << ended.out << ended.err;
    EXPECT_THAT(ended.err, StartsWith("silhouette: ")) << what;
  }
}

TEST_F(SilhouetteWatch, StreamedChecksAnswerEachLine) {
  Publish(kWall);
  const auto check = [&](const std::string& input, const std::string& options = "") {
    return cell_.shell().Run("printf '" + input + "' | SILHOUETTE_SERVER=" + cell_.address() + " " +
                             ProgramFolder() + "/silhouette check --stream " + options);
  };
  const Ended text = check("0,0\\n# nothing\\n\\n0.6 0 # the wall\\n-5,0");
  EXPECT_EQ(text.exit_code, 1) << text.err;
  EXPECT_THAT(text.out, MatchesRegex("0,0: free[^\n]*\n0.6,0: occupied\n-5,0: unknown: the "
                                     "configuration is outside the grid\n"));
  EXPECT_EQ(check("0,0\\n0,0.1\\n").exit_code, 0);
  const std::vector<Json> lines = LinesOf(check("0,0\\n\\n0.6,0\\n", "--format json").out);
  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_EQ(lines[0]["line"], 1);
  EXPECT_EQ(lines[0]["state"], "free");
  EXPECT_EQ(lines[0]["scene_id"], 1);
  EXPECT_EQ(lines[1]["line"], 3);
  EXPECT_EQ(lines[1]["state"], "occupied");
  const Ended mistake = check("0,0\\nnonsense\\n0,0\\n");
  EXPECT_EQ(mistake.exit_code, 2);
  EXPECT_THAT(mistake.out, MatchesRegex("0,0: free[^\n]*\n"));
  EXPECT_THAT(mistake.err, HasSubstr("-:2: "));
  const Ended too_few = check("0,0\\n\\n0\\n");
  EXPECT_EQ(too_few.exit_code, 2);
  EXPECT_THAT(too_few.err, StartsWith("silhouette: -:3: "));
  EXPECT_EQ(cell_.Run("check --stream 0,0").exit_code, 2);
  for (const char* nothing : {"check --stream <&-", "check --stream </dev/null"}) {
    const Ended empty = cell_.Run(nothing);
    EXPECT_EQ(empty.exit_code, 2) << "what was not asked is not free";
    EXPECT_THAT(empty.err, HasSubstr("standard input has no configuration"));
  }
  // It does not wait for input that never ends.
  const Ended refused = cell_.shell().Run(
      "mkfifo in; sleep 60 >in & writer=$!; printf '0\\n' >in & SILHOUETTE_SERVER=" +
      cell_.address() + " timeout 20 " + ProgramFolder() +
      "/silhouette check --stream <in; code=$?; kill $writer; exit $code");
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  cell_.StopServer();
  EXPECT_EQ(check("0,0\\n").exit_code, 3);
}

TEST(SilhouetteCheck, StreamThatIsRefusedEndsHoweverManyLinesThereAre) {
  const SmallServedCell cell("  limits: {streams_per_client: 1}\n");
  const Ended refused = cell.shell().Run(
      "export SILHOUETTE_SERVER=" + cell.address() + "; PATH=" + ProgramFolder() +
      ":$PATH; silhouette watch 0,0 >watched & watch=$!; "
      "until [ -s watched ]; do sleep 0.1; done; "
      "for line in $(seq 1000); do echo 0,0; done | timeout 30 silhouette check --stream; "
      "code=$?; kill $watch; exit $code");
  EXPECT_NE(refused.exit_code, 124) << "it did not end";
  EXPECT_THAT(refused.err, HasSubstr("streams_per_client"));
}

}  // namespace
}  // namespace silhouette
