// SPDX-License-Identifier: Apache-2.0
#include "server/page/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/page/snapshot.h"
#include "tests/server/drawn_cell.h"
#include "tests/server/page/looking.h"
#include "tests/server/tool_variant.h"

namespace silhouette {
namespace {

using nlohmann::json;

class PageTest : public testing::Test {
 protected:
  PageTest() : test(NewDatabase({.index = true})), page(StartPage(test)) {}

  TestServer test;
  std::unique_ptr<CellPage> page;
};

TEST_F(PageTest, ShowsTheSceneAsTheApiReturnsIt) {
  test.Publish(SceneWithBlock(2));
  const json now = SeenOn(*page);
  v1::GetSceneRequest request;
  request.set_include_planes(true);
  const v1::Scene scene = test.Ask(&v1::SceneService::Stub::GetScene, request).scene();
  EXPECT_EQ(now["scene"], JsonText(scene));
  EXPECT_EQ(now["basis"], JsonText(test.Check({At(0, 0)}).basis()));
  EXPECT_EQ(now["blocked"], "");
  v1::Mask robot;
  Set(RobotMask(1, 0, 0), &robot);
  EXPECT_EQ(now["views"]["right"]["robot"], JsonText(robot));
}

TEST_F(PageTest, ShowsTheMapThatTheApiReturns) {
  test.Publish(SceneWithBlock(2));
  const json now = SeenOn(*page, "?x=0&y=1");
  std::string expected;
  std::map<std::string, int> counts;
  for (int b = 0; b < 8; ++b) {
    for (int a = 0; a < 5; ++a) {
      const auto state = test.CheckOne(At(a, b)).state();
      expected += state == v1::Verdict::STATE_FREE ? 'f' : 'o';
      ++counts[state == v1::Verdict::STATE_FREE ? "free" : "occupied"];
    }
  }
  counts["unknown"] = 0;
  EXPECT_EQ(now["space"]["cells"], expected);
  EXPECT_THAT(expected, testing::AllOf(testing::HasSubstr("f"), testing::HasSubstr("o")));
  EXPECT_EQ(now["space"]["counts"], json(counts));
  EXPECT_EQ(now["space"]["counted"], true);
  EXPECT_EQ(now["present"]["state"], "free");
}

TEST(PageOfADrawnRobot, CountsTheWholeSpaceOnlyWhereASliceHasAllTiles) {
  storage::v1::CellDescription cell = DrawnCellDescription();
  Configuration at = {2, 0};
  for (const bool slice_has_all : {true, false}) {
    const auto created = Database::Create(FreshFolder() / "db", cell);
    ASSERT_TRUE(created.ok()) << created.status();
    const auto database = ServedDatabase::Load(
        **created, {.margin = 0}, {}, std::nullopt,
        {.calibration = DrawnCalibration(),
         .drawn =
             DrawnCell{.robot = std::make_shared<const RobotModel>(DrawnModel()), .parts = {}}});
    ASSERT_TRUE(database.ok()) << database.status();
    TestServer test(*database);
    const auto page = StartPage(test);
    EXPECT_EQ(SeenOn(*page)["space"]["counted"], slice_has_all) << "without a scene, too";
    test.Publish(DrawnSceneInput(*(*database)->robot_images().drawn(), at, {}));
    // A tile that is drawn too late for a snapshot is in the next one.
    const json space = SeenOn(*page, "", [&](const json& now) {
      return now["space"][slice_has_all ? "counts" : "cells"] != nullptr;
    })["space"];
    EXPECT_EQ(space["counted"], slice_has_all);
    EXPECT_EQ(space["counts"].is_object(), slice_has_all) << space;
    cell.clear_fixed_joints();
    storage::v1::GridJoint& reach = *cell.add_grid_joints();
    reach.set_name("reach");
    reach.set_upper(0.2);
    reach.set_steps(5000);
    at.push_back(0.1);
  }
}

TEST_F(PageTest, UnitsOfJointsAreThoseOfTheModel) {
  EXPECT_EQ(SeenOn(*page)["units"], json({"", "rad"})) << "only a turning joint is continuous";
  ServingSettings settings;
  settings.joint_slides = {{"a", true}, {"b", false}};
  TestServer known(NewDatabase({.index = true}), settings);
  EXPECT_EQ(SeenOn(*StartPage(known))["units"], json({"m", "rad"}));
}

TEST_F(PageTest, WithoutASceneAllIsUnknown) {
  const json now = SeenOn(*page);
  EXPECT_EQ(now["blocked"], "no scene");
  EXPECT_EQ(now["valid_for"], 0);
  EXPECT_TRUE(now["scene"].is_null());
  EXPECT_TRUE(now["present"].is_null());
  EXPECT_TRUE(now["space"]["cells"].is_null());
  EXPECT_TRUE(now["space"]["counts"].is_null());
}

TEST_F(PageTest, AnOldSceneIsUnknownAndTheStopIsNoted) {
  test.Publish(SceneWithBlock(2));
  Looker before(*page, "", [](const json& event) { return event["stops"][0]["reason"] == ""; });
  before.Wait();
  EXPECT_EQ(before.event["now"]["present"]["state"], "free");
  test.clock.Advance(absl::Seconds(2));
  Looker looker(*page, "", [](const json& event) { return event["stops"].size() >= 3; });
  looker.Wait();
  const json& now = looker.event["now"];
  EXPECT_EQ(now["blocked"], "scene stale");
  EXPECT_EQ(now["present"]["state"], "unknown");
  EXPECT_TRUE(now["space"]["cells"].is_null());
  EXPECT_EQ(looker.event["stops"][0]["reason"], "scene stale");
  EXPECT_EQ(looker.event["stops"][1]["reason"], "");
  EXPECT_EQ(looker.event["stops"][2]["reason"], "no scene");
}

TEST_F(PageTest, AStopHasTheMessageOfItsReasonNotThatOfAnotherDefect) {
  SceneInput input = SceneWithBlock(2);
  input.views.pop_back();
  test.Publish(input);
  test.clock.Advance(absl::Seconds(2));
  Looker looker(*page, "",
                [](const json& event) { return event["stops"][0]["reason"] == "scene stale"; });
  looker.Wait();
  EXPECT_THAT(looker.event["stops"][0]["message"].get<std::string>(),
              testing::HasSubstr("old, older than max_age"));
}

TEST_F(PageTest, AViewThatTheSceneLacksIsNotShown) {
  SceneInput input = SceneWithBlock(2);
  input.views.pop_back();
  test.Publish(input);
  const json now = SeenOn(*page);
  EXPECT_EQ(now["scene"]["views"].size(), 2u);
  EXPECT_TRUE(now["views"]["top"]["robot"].is_null());
  EXPECT_FALSE(now["basis"]["defects"].empty() && now["scene"]["defects"].empty());
}

TEST_F(PageTest, AWatchedPathIsShownWithThePixelsThatConvictIt) {
  test.Publish(SceneWithBlock(2));
  v1::CheckPathRequest request;
  for (const int a : {0, 4}) Set(At(a, 4), request.add_waypoints());
  grpc::ClientContext context;
  const auto reader = test.collision->WatchPath(&context, request);
  v1::WatchPathResponse told;
  ASSERT_TRUE(reader->Read(&told));
  const json now = SeenOn(*page);
  ASSERT_EQ(now["paths"].size(), 1u);
  const json& path = now["paths"][0];
  EXPECT_EQ(path["state"], "occupied");
  EXPECT_EQ(path["check"], JsonText(told.check()));
  v1::Mask block;
  Set(Block(0, 2), &block);
  EXPECT_EQ(path["why"]["left"]["convicts"], JsonText(block));
  test.clock.Advance(absl::Seconds(2));
  const json later = SeenOn(*page);
  EXPECT_EQ(later["paths"][0]["state"], "unknown");
  context.TryCancel();
  reader->Finish();
  EXPECT_TRUE(Soon([&] { return SeenOn(*page)["paths"].empty(); }));
}

TEST(PageVariants, ABlockedPathIsShownWithTheRobotThatItsClientAsksAbout) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  AddTools(folder / "db");
  BuildIndex(folder / "db");
  TestServer test(LoadDatabase(folder / "db"));
  const auto page = StartPage(test);
  test.Publish(SceneWithBlock(2));
  v1::CheckPathRequest request;
  request.set_variant(kTool);
  Set(At(1, 1), request.add_waypoints());  // only the tool touches the block
  grpc::ClientContext context;
  const auto reader = test.collision->WatchPath(&context, request);
  v1::WatchPathResponse told;
  ASSERT_TRUE(reader->Read(&told));
  const json now = SeenOn(*page);
  ASSERT_EQ(now["paths"][0]["state"], "occupied");
  v1::Mask robot;
  Set(ToolMask(0, 1, 1), &robot);
  EXPECT_EQ(now["paths"][0]["why"]["left"]["robot"], JsonText(robot));
  v1::Mask convicts;
  Set(ToolMask(0, 1, 1) & Block(0, 2), &convicts);
  EXPECT_EQ(now["paths"][0]["why"]["left"]["convicts"], JsonText(convicts));
  context.TryCancel();
  reader->Finish();
}

TEST(PageSnapshot, WhyAPathIsBlockedIsOfTheSceneThatIsShown) {
  const std::thread::id here = std::this_thread::get_id();
  int readings = -1;  // of the clock by this thread, until `meanwhile` comes
  std::function<void()> meanwhile;
  TestServer test(NewDatabase({.index = true}), {}, [&](const Clock& inner) -> Clock {
    return [&, inner] {
      if (std::this_thread::get_id() == here && readings-- == 0) meanwhile();
      return inner();
    };
  });
  Serving& serving = test.server->serving();
  test.Publish(SceneWithBlock(2));
  v1::CheckPathRequest request;
  Set(At(2, 4), request.add_waypoints());
  v1::WatchPathResponse told;
  *told.mutable_check() = test.Path({At(2, 4)});
  const auto path = serving.watched_paths.Add("planner", request);
  path->Note(told, serving.settings.clock().running);
  const json before = PageSnapshot(serving, {});
  ASSERT_FALSE(before["paths"][0]["why"].is_null());
  meanwhile = [&] { test.Publish(EmptyCellScene()); };
  readings = 1;  // the first is of the request for the newest scene
  const json shown = PageSnapshot(serving, {});
  EXPECT_EQ(shown["scene"]["id"], before["scene"]["id"]);
  EXPECT_EQ(shown["paths"], before["paths"]);
  EXPECT_NE(PageSnapshot(serving, {})["paths"][0]["why"], before["paths"][0]["why"])
      << "a scene came meanwhile";
}

TEST_F(PageTest, OfManyWatchedPathsTheBlockedOnesAreShown) {
  test.Publish(SceneWithBlock(2));
  Serving& serving = test.server->serving();
  std::vector<std::shared_ptr<WatchedPath>> paths;
  for (const int a : {0, 0, 0, 0, 0, 0, 0, 0, 2}) {
    v1::CheckPathRequest request;
    Set(At(a, 4), request.add_waypoints());
    v1::WatchPathResponse told;
    *told.mutable_check() = test.Path({At(a, 4)});
    paths.push_back(serving.watched_paths.Add("planner", request));
    paths.back()->Note(told, serving.settings.clock().running);
  }
  const json now = SeenOn(*page);
  EXPECT_EQ(now["path_count"], 9);
  ASSERT_EQ(now["paths"].size(), 8u);
  EXPECT_EQ(now["paths"][0]["state"], "occupied");
  EXPECT_FALSE(now["paths"][0]["why"].is_null());
  EXPECT_EQ(now["paths"][1]["state"], "free");
}

TEST_F(PageTest, ValidityEndsWithTheAnswerHoweverLongNotingAndShowingItTake) {
  test.Publish(SceneWithBlock(2));
  test.clock.Run(absl::Milliseconds(1));
  v1::CheckPathRequest request;
  Set(At(0, 4), request.add_waypoints());
  grpc::ClientContext context;
  const auto reader = test.collision->WatchPath(&context, request);
  v1::WatchPathResponse told;
  ASSERT_TRUE(reader->Read(&told));
  const auto seconds = [](const google::protobuf::Duration& duration) {
    return static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos();
  };
  const auto end = [&](const v1::Basis& basis) {
    return seconds(basis.server_clock()) + seconds(basis.valid_for());
  };
  const json now = SeenOn(*page);
  ASSERT_EQ(now["paths"][0]["state"], "free");
  EXPECT_NEAR(now["paths"][0]["valid_until"], end(told.check().basis()), 1e-6);
  const auto until = now["clock"].get<double>() + now["valid_for"].get<double>();
  EXPECT_NEAR(until, end(told.check().basis()), 1e-6) << "the same scene";
  context.TryCancel();
  reader->Finish();
}

TEST_F(PageTest, WhileNobodyLooksNothingIsMade) {
  test.Publish(SceneWithBlock(2));
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  EXPECT_EQ(page->snapshots(), 0u);
  SeenOn(*page);
  // The server notices a closed connection at the second event after it.
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  const uint64_t made = page->snapshots();
  EXPECT_GE(made, 1u);
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  EXPECT_EQ(page->snapshots(), made);
}

TEST_F(PageTest, MakesAtMostTenSnapshotsASecond) {
  Looker looker(*page, "", [](const json&) { return false; });
  const auto began = std::chrono::steady_clock::now();
  std::chrono::duration<double> passed{};
  // On a busy machine the page, whose threads are niced, comes late.
  while (passed.count() < 1 || (page->snapshots() < 2 && passed.count() < 30)) {
    test.Publish(SceneWithBlock(2));
    passed = std::chrono::steady_clock::now() - began;
  }
  const auto made = static_cast<double>(page->snapshots());
  EXPECT_GE(made, 2);
  passed = std::chrono::steady_clock::now() - began;
  EXPECT_LE(made, 1 + 10 * passed.count());
}

TEST_F(PageTest, StreamsAreBounded) {
  const auto never = [](const json&) { return false; };
  std::vector<std::unique_ptr<Looker>> lookers;
  for (int i = 0; i < CellPage::kMostStreams; ++i) {
    lookers.push_back(std::make_unique<Looker>(*page, "", never));
    ASSERT_TRUE(Soon([&] { return lookers.back()->events > 0; }));
  }
  httplib::Client client("http://" + page->address());
  EXPECT_EQ(client.Get("/events")->status, 503);
  for (const char* path : {"/", "/clock"}) EXPECT_EQ(client.Get(path)->status, 200) << path;
  lookers.clear();
  EXPECT_TRUE(Soon([&] {
    Looker looker(*page, "", [](const json&) { return true; });
    looker.Wait();
    return looker.status == 200;
  }));
}

TEST_F(PageTest, EndsWhileSomebodyLooks) {
  Looker looker(*page, "", [](const json&) { return false; });
  ASSERT_TRUE(Soon([&] { return looker.events > 0; }));
  page.reset();
  looker.Wait();
}

TEST_F(PageTest, TheClockIsThatOfTheSnapshotsAndMakesNone) {
  test.clock.Advance(absl::Milliseconds(1500));
  httplib::Client client("http://" + page->address());
  const auto answer = client.Get("/clock");
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(answer->get_header_value("Cache-Control"), "no-store");
  EXPECT_EQ(page->snapshots(), 0u);
  EXPECT_EQ(json::parse(answer->body)["clock"], SeenOn(*page)["clock"]);
}

TEST_F(PageTest, NamesOfOthersAreRefusedAsHost) {
  httplib::Client client("http://" + page->address());
  const auto status = [&](const std::string& host) {
    return client.Get("/", {{"Host", host}})->status;
  };
  for (const char* host : {"localhost", "localhost:8080", "127.0.0.1:1", "[::1]", "[::1]:80"}) {
    EXPECT_EQ(status(host), 200) << host;
  }
  for (const char* host : {"evil.example", "evil.example:8080", "127.0.0.1.evil.example",
                           "localhost.evil.example", "[::1", "127.0.0.1:80:80"}) {
    EXPECT_EQ(status(host), 421) << host;
  }
}

TEST_F(PageTest, OtherSitesAndOtherMethodsAreRefused) {
  httplib::Client client("http://" + page->address());
  for (const char* path : {"/events", "/clock"}) {
    EXPECT_EQ(client.Get(path, {{"Sec-Fetch-Site", "cross-site"}})->status, 403) << path;
  }
  EXPECT_EQ(client.Post("/", "x", "text/plain")->status, 404);
  EXPECT_EQ(client.Get("/events?x=seven")->status, 400);
}

TEST_F(PageTest, OnlyItsOwnFilesRunInTheBrowser) {
  httplib::Client client("http://" + page->address());
  for (const char* path : {"/", "/page.js", "/regions.js", "/page.css", "/nothing"}) {
    const auto answer = client.Get(path);
    EXPECT_THAT(answer->get_header_value("Content-Security-Policy"),
                testing::AllOf(testing::HasSubstr("default-src 'none'"),
                               testing::Not(testing::HasSubstr("unsafe"))));
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff");
  }
}

TEST_F(PageTest, IsNotShownToOtherMachinesUnasked) {
  Serving& serving = test.server->serving();
  const auto refused = CellPage::Start("0.0.0.0:0", /*insecure=*/false, serving).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.message()), testing::HasSubstr("--insecure"));
  EXPECT_TRUE(CellPage::Start("0.0.0.0:0", /*insecure=*/true, serving).ok());
  EXPECT_EQ(CellPage::Start("unix:/tmp/page", false, serving).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(CellPage::Start(page->address(), false, serving).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST(SliceChoice, IsOfJointsAndSteps) {
  const auto choice = SliceChoiceFrom("2", "", "3,,0");
  ASSERT_TRUE(choice.ok());
  EXPECT_EQ(choice->x, 2);
  EXPECT_EQ(choice->y, 1);
  EXPECT_THAT(choice->at, testing::ElementsAre(3, std::nullopt, 0));
  for (const auto& [x, at] : {std::pair("-1", ""),
                              {"7", ""},
                              {"a", ""},
                              {"", "-1"},
                              {"", "x"},
                              {"", "1,1,1,1,1,1,1,1"},
                              {"", "99999999999"}}) {
    EXPECT_FALSE(SliceChoiceFrom(x, "", at).ok()) << x << " " << at;
  }
}

TEST_F(PageTest, WhatTheGridLacksIsReplaced) {
  test.Publish(SceneWithBlock(2));
  const json now = SeenOn(*page, "?x=5&y=6&at=99,99,99");
  EXPECT_EQ(now["space"]["x"], 0);
  EXPECT_EQ(now["space"]["y"], 1);
  EXPECT_EQ(now["space"]["at"], json({4, 7}));
  EXPECT_EQ(now["space"]["cells"].get<std::string>().size(), 40u);
}

}  // namespace
}  // namespace silhouette
