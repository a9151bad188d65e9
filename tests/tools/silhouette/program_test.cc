// SPDX-License-Identifier: Apache-2.0
// The program `silhouette` against the real server, as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "tests/clients/cpp/fake_server.h"
#include "tests/folders.h"
#include "tests/tools/silhouette/small_served_cell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

class Silhouette : public testing::Test {
 protected:
  // A new cell for each test: no test sees the scene of another.
  SmallServedCell cell_;

  Json RunJson(const std::string& arguments, int exit_code) {
    const Ended ended = cell_.Run(arguments + " --format json");
    EXPECT_EQ(ended.exit_code, exit_code) << arguments << ": " << ended.out << ended.err;
    return Json::parse(ended.out, nullptr, false);
  }

  void PublishWall() {
    const Ended ended = cell_.Publish(kWall, kWall);
    ASSERT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  }

  // Whether the robot at grid index (x, y) touches the wall.
  static bool Touches(int x, int y) { return Intersects(RobotAt(x, y).words(), kWall.words()); }
};

TEST_F(Silhouette, BeforeTheFirstSceneNothingIsFree) {
  const Ended check = cell_.Run("check 0.1,0.2");
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_THAT(check.out, AllOf(HasSubstr("unknown: there is no scene"), HasSubstr("publish")));
  const Json space = RunJson("space", 0);
  EXPECT_EQ(space["unknown"], 121);
  EXPECT_EQ(space["free"], 0);
  EXPECT_EQ(space["unknown_reason"], "no scene");
  EXPECT_EQ(cell_.Run("path 0,0 0.1,0").exit_code, 1);
  std::ofstream(cell_.shell().folder() / "path.json") << R"({"waypoints": [[0, 0]]})";
  const Ended plan = cell_.Run("plan 0,0 1,1 --out path.json");
  EXPECT_EQ(plan.exit_code, 1);
  EXPECT_THAT(plan.out, HasSubstr("no path: the start is unknown: there is no scene"));
  const Json no_path = Json::parse(ContentOf(cell_.shell().folder() / "path.json"));
  EXPECT_EQ(no_path["waypoints"], Json::array()) << "a path of an earlier plan must not stay";
  EXPECT_EQ(cell_.Run("path --file path.json").exit_code, 2);
  EXPECT_EQ(cell_.Run("explain 0.1,0.2 --out unknown").exit_code, 1);
  EXPECT_FALSE(
      cv::imread((cell_.shell().folder() / "unknown" / "explanation.png").string()).empty())
      << "the sheet says why";
  const Ended show = cell_.Run("scene show");
  EXPECT_EQ(show.exit_code, 2);
  EXPECT_THAT(show.err, HasSubstr("scene"));
}

TEST_F(Silhouette, CheckTellsFreeAndOccupiedByExitCode) {
  PublishWall();
  EXPECT_EQ(cell_.Run("check 0,0").exit_code, 0);
  EXPECT_EQ(cell_.Run("check 0.6,0.2").exit_code, 1);
  EXPECT_EQ(cell_.Run("check 0,0 0.6,0.2").exit_code, 1);
  EXPECT_EQ(cell_.Run("check 5,5").exit_code, 1) << "outside the grid";
  EXPECT_THAT(cell_.Run("check 5,5").out, Not(HasSubstr("degrees")));
  for (const char* command : {"check 90,0", "explain 90,0", "plan 90,0 0,0", "plan 0,0 90,0"}) {
    EXPECT_THAT(cell_.Run(command).out, HasSubstr("did you mean degrees?")) << command;
  }
  const Json answer = RunJson("check 0,0 0.6,0.2 --repeat 5", 1);
  EXPECT_EQ(answer["scene_id"], 1);
  EXPECT_GT(answer["valid_for_s"], 0);
  EXPECT_EQ(answer["all_free"], false);
  EXPECT_EQ(answer["configurations"][0]["state"], "free");
  EXPECT_EQ(answer["configurations"][1]["state"], "occupied");
  EXPECT_EQ(answer["configurations"][1]["views"][0]["view"], "left");
  EXPECT_GT(answer["configurations"][1]["views"][0]["obstacle_pixels"], 0);
  EXPECT_EQ(answer["checks"], 5);
  EXPECT_GT(answer["check_p50_us"], 0);
  EXPECT_GE(answer["check_p99_us"], answer["check_p50_us"]);
}

TEST_F(Silhouette, CheckReadsConfigurationsInDegreesAndFromAFile) {
  PublishWall();
  // 0.6 rad is 34.4 degrees.
  EXPECT_EQ(RunJson("check 34.4deg,0.2", 1)["configurations"][0]["state"], "occupied");
  EXPECT_EQ(RunJson("check --degrees 34.4,0.2rad", 1)["configurations"][0]["state"], "occupied");
  WriteFile(cell_.shell().folder() / "list.txt", "0,0\n0,0.1  # both free\n");
  EXPECT_EQ(RunJson("check --file list.txt", 0)["configurations"].size(), 2u);
  EXPECT_EQ(RunJson("check --file - <list.txt", 0)["configurations"].size(), 2u);
}

TEST_F(Silhouette, PolicyOptionsReachTheServer) {
  // Each view sees its own obstacle: one view's word is enough by default, both agree nowhere.
  ASSERT_EQ(cell_.Publish(Block(7, 0, 8, 15), Block(0, 13, 5, 14)).exit_code, 0);
  EXPECT_EQ(cell_.Run("check 0.6,0").exit_code, 1);
  EXPECT_EQ(cell_.Run("check 0.6,0 --preset paper").exit_code, 0);
  EXPECT_EQ(cell_.Run("check 0.6,0 --min-views 2").exit_code, 0);
  EXPECT_EQ(cell_.Run("check 0.6,0 --max-occluded-views 0").exit_code, 0);
  const Ended wrong = cell_.Run("check 0.6,0 --min-views 3");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("min_views"));
  // The cell is not calibrated.
  for (const std::string options : {"--preset calibrated", "--preset paper-calibrated"}) {
    const Ended refused = cell_.Run("check 0.6,0 " + options);
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err, HasSubstr("needs a calibration"));
  }
  // Between 0.3 (free) and 0.4 (occupied).
  EXPECT_EQ(cell_.Run("check 0.34,0 --off-grid nearest").exit_code, 0);
  EXPECT_EQ(cell_.Run("check 0.34,0 --off-grid cell").exit_code, 1);
}

TEST_F(Silhouette, PathTellsTheFirstPlaceThatIsNotFree) {
  PublishWall();
  EXPECT_EQ(cell_.Run("path 0,0 0,1 1,1 1,0").exit_code, 0);
  const Json answer = RunJson("path 0,0 0,0.2 1,0.2", 1);
  EXPECT_EQ(answer["state"], "occupied");
  EXPECT_EQ(answer["segment"], 1);
  // Free up to x = 0.3: the cell after it has an occupied corner.
  EXPECT_NEAR(answer["configuration"][0], 0.35, 0.051);
  EXPECT_EQ(cell_.Run("path --file missing.json").exit_code, 2);
}

TEST_F(Silhouette, CheckTellsTheClearanceIfAskedFor) {
  PublishWall();
  // The wall begins in column 7; the robot at x = 0.1 ends in column 4.
  const Json answer = RunJson("check 0.1,0 0.6,0.2 5,5 --clearance", 1)["configurations"];
  EXPECT_EQ(answer[0]["clearance"], 2.0);
  EXPECT_EQ(answer[0]["views"][1]["distance"], 2.0);
  EXPECT_EQ(answer[1]["clearance"], 0.0);
  EXPECT_TRUE(answer[2]["clearance"].is_null()) << "outside the grid";
  EXPECT_FALSE(RunJson("check 0.1,0", 0)["configurations"][0].contains("clearance"));
  EXPECT_THAT(cell_.Run("check 0.1,0 --clearance").out, HasSubstr("free, clearance 2 px ("));
  ASSERT_EQ(cell_.Publish(kNothing, kNothing).exit_code, 0);
  EXPECT_EQ(RunJson("check 0.1,0 --clearance", 0)["configurations"][0]["clearance"], "Infinity");
  EXPECT_THAT(cell_.Run("check 0.1,0 --clearance").out, HasSubstr("clearance without limit ("));
}

TEST_F(Silhouette, PathTellsTheSmallestClearanceAndWhereItIs) {
  PublishWall();
  const Json answer = RunJson("path 0,0 0.2,0 0,0 --clearance", 0);
  EXPECT_EQ(answer["clearance"], 1.0);
  EXPECT_EQ(answer["narrowest"]["segment"], 0);
  // Between 0.1 and 0.2 the robot may be at either.
  EXPECT_NEAR(answer["narrowest"]["configuration"][0], 0.15, 1e-9);
  EXPECT_NEAR(answer["narrowest"]["fraction"], 0.75, 1e-9);
  EXPECT_THAT(cell_.Run("path 0,0 0.2,0 0,0 --clearance").out,
              AllOf(HasSubstr("clearance 1 px"), HasSubstr("narrowest at 0.15,0, 75 %")));
  EXPECT_FALSE(RunJson("path 0,0 0.2,0 0,0", 0).contains("narrowest"));
  const Json blocked = RunJson("path 0,0 1,0 --clearance", 1);
  EXPECT_EQ(blocked["clearance"], 0.0);
  EXPECT_FALSE(blocked.contains("narrowest"));
}

TEST_F(Silhouette, SpaceHasTheVerdictOfEveryConfiguration) {
  PublishWall();
  const Json counts = RunJson("space --out space.json --picture space.png", 0);
  const Json space = Json::parse(ContentOf(cell_.shell().folder() / "space.json"));
  ASSERT_EQ(space["configurations"].size(), 121u);
  int occupied = 0;
  for (const Json& entry : space["configurations"]) {
    const int x = static_cast<int>(std::lround(entry["configuration"][0].get<double>() / kStep));
    const int y = static_cast<int>(std::lround(entry["configuration"][1].get<double>() / kStep));
    EXPECT_EQ(entry["state"], Touches(x, y) ? "occupied" : "free") << x << ", " << y;
    occupied += Touches(x, y) ? 1 : 0;
  }
  EXPECT_EQ(counts["occupied"], occupied);
  EXPECT_EQ(counts["free"], 121 - occupied);
  EXPECT_EQ(counts["unknown"], 0);
  EXPECT_GT(counts["space_ms"], 0);
  EXPECT_GT(cv::imread((cell_.shell().folder() / "space.png").string()).cols, 100);
  ASSERT_EQ(cell_.Run("space --out space.csv").exit_code, 0);
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "space.csv"),
              AllOf(HasSubstr("number,x,y,state\n0,0,0,free\n"), HasSubstr(",occupied\n")));
  const Ended wrong = cell_.Run("space --out space.xml");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr(".json or .csv"));
}

TEST_F(Silhouette, SpaceTellsClearancesInLevels) {
  PublishWall();
  const std::string files = " --out space.json --picture space.png";
  const Json counts = RunJson("space --clearance 0,1,2.5" + files, 0);
  const Json space = Json::parse(ContentOf(cell_.shell().folder() / "space.json"));
  std::string list;
  for (const Json& entry : space["configurations"]) {
    const Json& q = entry["configuration"];
    list += q[0].dump() + "," + q[1].dump() + "\n";
  }
  WriteFile(cell_.shell().folder() / "list.txt", list);
  const Json checks = RunJson("check --file list.txt --clearance", 1)["configurations"];
  ASSERT_EQ(checks.size(), 121u);
  const std::vector<double> levels = {0, 1, 2.5};
  std::vector<int> above(3, 0);
  for (size_t at = 0; at < checks.size(); ++at) {
    Json expected;
    for (size_t i = 0; i < levels.size(); ++i) {
      if (checks[at]["clearance"] <= levels[i]) continue;
      expected = levels[i];
      ++above[i];
    }
    EXPECT_EQ(space["configurations"][at]["clearance_above"], expected) << checks[at];
  }
  EXPECT_GT(above[2], 0);
  EXPECT_LT(above[2], above[1]);
  for (size_t i = 0; i < levels.size(); ++i) {
    EXPECT_EQ(counts["clearance_levels"][i],
              (Json{{"above", levels[i]}, {"configurations", above[i]}}));
  }
  EXPECT_GT(cv::imread((cell_.shell().folder() / "space.png").string()).cols, 100);
  EXPECT_FALSE(RunJson("space", 0).contains("clearance_levels"));
  EXPECT_THAT(cell_.Run("space --clearance 1,2.5 --out space.csv").out,
              HasSubstr("free with a clearance above 2.5 px:  " + std::to_string(above[2])));
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "space.csv"),
              AllOf(HasSubstr(",state,clearance_above\n"), HasSubstr(",free,2.5\n"),
                    HasSubstr(",occupied,\n")));
  const Ended wrong = cell_.Run("space --clearance 2,1");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("clearance levels must ascend"));
  EXPECT_EQ(cell_.Run("space --clearance much").exit_code, 2);
}

TEST_F(Silhouette, SpaceThatTheServerHadNoTimeForIsUnknown) {
  PublishWall();
  const Ended ended = cell_.Run("space --max-time 1e-9s");
  EXPECT_EQ(ended.exit_code, 0);
  EXPECT_THAT(ended.out, AllOf(HasSubstr("121 unknown"), HasSubstr("1 of 1 tiles; ask again")));
  const Json counts = RunJson("space --max-time 10s", 0);
  EXPECT_EQ(counts["unknown"], 0);
  EXPECT_EQ(counts["tiles_left_out"], 0);
  EXPECT_EQ(cell_.Run("space --max-time soon").exit_code, 2);
}

TEST_F(Silhouette, PlanLeadsAroundTheWallAndIsJudgedByTheTruth) {
  PublishWall();
  // The truth: the wall ends a row higher, and there is contact at one place more.
  std::string truth = "number,x,y,contact,distance\n";
  int missing = 0;
  int additional = 0;
  const Json space = [&] {
    cell_.Run("space --out space.json");
    return Json::parse(ContentOf(cell_.shell().folder() / "space.json"));
  }();
  for (const Json& entry : space["configurations"]) {
    const int x = static_cast<int>(std::lround(entry["configuration"][0].get<double>() / kStep));
    const int y = static_cast<int>(std::lround(entry["configuration"][1].get<double>() / kStep));
    const bool contact = (Touches(x, y) && y < 8) || (x == 0 && y == 3);
    missing += contact && !Touches(x, y) ? 1 : 0;
    additional += !contact && Touches(x, y) ? 1 : 0;
    truth += entry["number"].dump() + "," + entry["configuration"][0].dump() + "," +
             entry["configuration"][1].dump() + (contact ? ",1,0\n" : ",0,0.1\n");
  }
  WriteFile(cell_.shell().folder() / "truth.csv", truth);
  const Json plan = RunJson(
      "plan 0,0 1,0 --truth truth.csv --out path.json --picture configuration-space.png", 0);
  EXPECT_EQ(plan["found"], true);
  EXPECT_EQ(plan["configurations"], 121);
  EXPECT_EQ(plan["missing"], missing);
  EXPECT_EQ(plan["additional"], additional);
  EXPECT_EQ(missing, 1);
  // Down to the first row below the wall, across, and up again.
  int row = 0;
  while (Touches(5, row)) ++row;
  EXPECT_EQ(plan["length_steps"], 10 + 2 * row);
  const Json path = Json::parse(ContentOf(cell_.shell().folder() / "path.json"));
  EXPECT_EQ(path["waypoints"].size(), plan["path_waypoints"]);
  EXPECT_EQ(path["waypoints"].front(), Json({0.0, 0.0}));
  EXPECT_EQ(cell_.Run("path --file path.json").exit_code, 0);
  EXPECT_THAT(cell_.Run("path --degrees --file path.json").err, HasSubstr("radians and metres"));
  EXPECT_GT(cv::imread((cell_.shell().folder() / "configuration-space.png").string()).cols, 100);
  for (const char* planner : {"rrtconnect", "lbkpiece"}) {
    const Json other =
        RunJson(std::string("plan 0.05,0.02 0.97,0.03 --out other.json --planner ") + planner, 0);
    EXPECT_EQ(other["planner"], planner);
    EXPECT_EQ(cell_.Run("path --file other.json").exit_code, 0);
  }
  EXPECT_THAT(cell_.Run("plan 0,0 1,0 --planner lbkpiece --picture none.png").err,
              HasSubstr("lbkpiece uses none"));
  const Json diagonal = RunJson("plan 0.05,0.02 0.97,0.03 --diagonal", 0);
  EXPECT_LT(diagonal["length_steps"], plan["length_steps"]);
}

TEST_F(Silhouette, PlanSaysWhyThereIsNoPath) {
  ASSERT_EQ(cell_.Publish(Block(7, 0, 8, 15), kNothing).exit_code, 0);
  const Ended none = cell_.Run("plan 0,0 1,0 --picture none.png");
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.out, HasSubstr("no way leads from the start to the goal"));
  EXPECT_TRUE(std::filesystem::exists(cell_.shell().folder() / "none.png"));
  EXPECT_THAT(cell_.Run("plan 0.6,0 1,0").out, HasSubstr("the start is occupied"));
  EXPECT_THAT(cell_.Run("plan 0,0 0.6,0").out, HasSubstr("the goal is occupied"));
  EXPECT_THAT(cell_.Run("plan 0,0 7,0").out, HasSubstr("the goal is outside the grid"));
  const Ended wrong = cell_.Run("plan 0,0,0 1,0");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("3"));
}

// With two views needed, a grid cell can be occupied though its corners are free.
TEST_F(Silhouette, PlanAvoidsMovesBetweenFreePointsThatAreNotFree) {
  // One view sees an obstacle from x = 0.4 on, the other up to x = 0.3, both down to y = 0.8.
  ASSERT_EQ(cell_.Publish(Block(7, 0, 15, 9), Block(4, 0, 4, 9)).exit_code, 0);
  const Json space = RunJson("space --preset paper", 0);
  EXPECT_EQ(space["occupied"], 0);
  EXPECT_EQ(cell_.Run("path 0.3,0 0.4,0 --preset paper").exit_code, 1);
  const Json plan = RunJson("plan 0.2,0 0.6,0 --preset paper --out path.json", 0);
  EXPECT_GT(plan["blocked_moves"], 0);
  EXPECT_GT(plan["length_steps"], 4 + 2 * 8);
  EXPECT_EQ(cell_.Run("path --file path.json --preset paper").exit_code, 0);
}

TEST_F(Silhouette, SceneIsPublishedFromAFolderAndShown) {
  const std::filesystem::path images = cell_.shell().folder() / "images";
  WriteMask(images / "l.png", kWall | RobotAt(2, 0));
  WriteMask(images / "r.png", RobotAt(2, 0));
  WriteFile(images / "images.json",
            R"({"time": "2020-01-31T12:00:00Z", "joints": {"x": 0.2, "y": 0},
                "views": {"left": "l.png", "right": "r.png"}})");
  const Ended old = cell_.Run("scene publish images --as mask");
  EXPECT_EQ(old.exit_code, 1) << "nothing is free from images of 2020";
  EXPECT_THAT(old.out, HasSubstr("not free: "));
  EXPECT_THAT(cell_.Run("check 0,0").out, HasSubstr("older than max_age"));
  const Json scene = RunJson("scene publish images --as mask --now", 0);
  EXPECT_EQ(scene["views"][0]["foreground_pixels"], (kWall | RobotAt(2, 0)).Count());
  EXPECT_EQ(scene["views"][1]["obstacle_pixels"], 0);
  EXPECT_EQ(scene["joints"]["x"], 0.2);
  EXPECT_EQ(cell_.Run("check 0,0").exit_code, 0);
  const Json shown = RunJson("scene show --picture views.png --images images", 0);
  EXPECT_EQ(shown["scene_id"], scene["scene_id"]);
  EXPECT_EQ(shown["views"], scene["views"]);
  EXPECT_GT(cv::imread((cell_.shell().folder() / "views.png").string()).cols, 500);
  EXPECT_EQ(cell_.Run("scene show --id 77").exit_code, 2);
}

TEST_F(Silhouette, SceneWithADefectIsToldAndNotFree) {
  WriteMask(cell_.shell().folder() / "left.png", RobotAt(0, 0));
  const Ended publish =
      cell_.Run("scene publish --as mask --view left=left.png --joint x=0 --joint y=0");
  EXPECT_EQ(publish.exit_code, 1);
  EXPECT_THAT(publish.out, AllOf(HasSubstr("not free"), HasSubstr("right")));
  EXPECT_EQ(cell_.Run("check 0,0").exit_code, 1);
  const Ended no_joints = cell_.Publish(kNothing, kNothing, "");
  EXPECT_EQ(no_joints.exit_code, 0);
  EXPECT_EQ(
      cell_.Run("scene publish --as mask --view left=left.png --view right=left.png").exit_code, 1)
      << "the robot's position was not told";
}

TEST_F(Silhouette, SceneIsPublishedWithTheVariantThatIsNamed) {
  EXPECT_EQ(cell_.Publish(kNothing, kNothing, "--variant default").exit_code, 0);
  const Ended unknown = cell_.Publish(kNothing, kNothing, "--variant gripper");
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.out, HasSubstr("no variant 'gripper'"));
}

TEST_F(Silhouette, ObstacleMasksNeedNoRobotInThem) {
  WriteMask(cell_.shell().folder() / "wall.png", kWall);
  ASSERT_EQ(cell_
                .Run("scene publish --as obstacles --view left=wall.png --view right=wall.png "
                     "--joint x=0 --joint y=0")
                .exit_code,
            0);
  EXPECT_EQ(cell_.Run("check 0,0").exit_code, 0);
  EXPECT_EQ(cell_.Run("check 0.6,0.2").exit_code, 1);
}

TEST_F(Silhouette, WrongImagesAreNamed) {
  const auto fails = [&](const std::string& arguments, const std::string& what) {
    const Ended ended = cell_.Run("scene publish --as mask " + arguments);
    EXPECT_EQ(ended.exit_code, 2) << arguments;
    EXPECT_THAT(ended.err, HasSubstr(what)) << arguments;
  };
  WriteMask(cell_.shell().folder() / "small.png", Mask({8, 8}));
  WriteFile(cell_.shell().folder() / "text.png", "no image");
  fails("", "--view");
  fails("--view left", "name=file");
  fails("--view left=missing.png", "missing.png");
  fails("--view left=small.png", "small.png");
  fails("--view left=text.png", "text.png");
  fails("--view top=small.png", "it has left, right");
  fails("--view left=small.png --joint x", "name=value");
  fails("--view left=wall.png --view left=left.png", "--view left stands twice; give it once");
  fails("--view left=left.png --joint x=0 --joint x=1", "--joint x stands twice; give it once");
  fails("nowhere", "images.json");
}

TEST_F(Silhouette, ExplainTellsTheVotesAndWritesTheImages) {
  ASSERT_EQ(cell_.Publish(kWall, kNothing).exit_code, 0);
  const Ended explain = cell_.Run("explain 0.6,0.2 --out why");
  EXPECT_EQ(explain.exit_code, 1);
  EXPECT_THAT(explain.out, AllOf(HasSubstr("is occupied"),
                                 HasSubstr("1 of 2 views have obstacle pixels inside the robot")));
  for (const char* name :
       {"left_scene.png", "left_obstacle.png", "left_intersection.png", "right_collision.png"}) {
    const cv::Mat image = cv::imread((cell_.shell().folder() / "why" / name).string());
    EXPECT_EQ(image.cols, 16) << name;
  }
  EXPECT_GT(cv::imread((cell_.shell().folder() / "why" / "explanation.png").string()).cols, 500);
  EXPECT_EQ(cell_.Run("explain 0,0.5").exit_code, 0);
  EXPECT_EQ(cell_.Run("explain 0.6,0.2 --images nowhere").exit_code, 2) << "a picture needs --out";
  EXPECT_THAT(cell_.Run("explain 0.6,0.2 --out why --images nowhere").err, HasSubstr("nowhere"));
}

TEST_F(Silhouette, AnswersAreInDegreesWhereTheQuestionIs) {
  PublishWall();
  EXPECT_THAT(cell_.Run("check 34.4deg,0.2 0.6,0.2").out,
              AllOf(StartsWith("34.4deg,0.2: occupied"), HasSubstr("\n0.6,0.2: occupied")));
  EXPECT_THAT(cell_.Run("check --degrees 34.4,0.2rad").out, StartsWith("34.4deg,0.2rad: occupied"));
  EXPECT_THAT(cell_.Run("explain 34.4deg,0.2").out, StartsWith("34.4deg,0.2 is occupied"));
}

TEST_F(Silhouette, RegionIsAllowedListedNamedAndRevoked) {
  PublishWall();
  ASSERT_EQ(cell_.Run("check 0.6,0.2").exit_code, 1);
  EXPECT_THAT(cell_.Run("region list").out, HasSubstr("no allowed region"));
  WriteMask(cell_.shell().folder() / "wall.png", kWall);
  const Ended allow = cell_.Run(
      "region allow part 'left:6.5,-0.5;8.5,-0.5;8.5,9.5;6.5,9.5' --mask right=wall.png --for "
      "5min");
  EXPECT_EQ(allow.exit_code, 0) << allow.err;
  EXPECT_THAT(allow.out, AllOf(HasSubstr("'part'"), HasSubstr("left 20, right 20 pixels")));
  const Ended check = cell_.Run("check 0.6,0.2 0,0");
  EXPECT_EQ(check.exit_code, 0) << check.out;
  EXPECT_THAT(check.out, HasSubstr("(obstacles allowed in 'part')"));
  const Json answer = RunJson("check 0.6,0.2 0,0", 0);
  EXPECT_EQ(answer["scene_regions"], Json::array({"part"}));
  EXPECT_EQ(answer["configurations"][0]["regions"], Json::array({"part"}));
  EXPECT_EQ(answer["configurations"][1]["regions"], Json::array());
  EXPECT_EQ(RunJson("path 0,0.2 1,0.2", 0)["regions"], Json::array({"part"}));
  EXPECT_EQ(RunJson("space", 0)["scene_regions"], Json::array({"part"}));
  EXPECT_EQ(cell_.Run("explain 0.6,0.2 --out why").exit_code, 0);
  const Json list = RunJson("region list", 0);
  ASSERT_EQ(list["regions"].size(), 1u);
  EXPECT_EQ(list["regions"][0]["views"][1]["view"], "right");
  EXPECT_EQ(list["regions"][0]["views"][1]["pixels"], 20);
  EXPECT_GT(list["regions"][0]["remaining_s"], 200);
  EXPECT_EQ(cell_.Run("region revoke part").exit_code, 0);
  EXPECT_EQ(cell_.Run("region revoke part").exit_code, 1);
  EXPECT_EQ(cell_.Run("check 0.6,0.2").exit_code, 1);
}

TEST_F(Silhouette, MistakesOnTheCommandLineAreOneSentenceThatNamesThem) {
  PublishWall();
  const auto error = [&](const std::string& arguments) {
    const Ended ended = cell_.Run(arguments);
    EXPECT_EQ(ended.exit_code, 2) << arguments << ": " << ended.out;
    EXPECT_LT(ended.err.size(), 200u);
    return ended.err;
  };
  EXPECT_THAT(error("path 0,0 0,1 --separation --horizon inf"),
              HasSubstr("'inf' is not a length; write metres, or e.g. '30 mm'"));
  EXPECT_THAT(error("path 0,0 0,1 --separation --horizon -1"), HasSubstr("'-1' is less than 0"));
  EXPECT_THAT(error("scene bogus"),
              HasSubstr("there is no subcommand 'bogus'; known are 'publish'"));
  EXPECT_THAT(error("check 0,0 --preset ''"), HasSubstr("leave the option out"));
  EXPECT_THAT(error("check 0,0 --repeat 0"), HasSubstr("'0' is not a number above zero"));
  EXPECT_THAT(error("check 0,0 --timeout 1e-12"),
              HasSubstr("--timeout: '1e-12' is not from 1 ms to 277 h 46 min"));
  EXPECT_THAT(error("check 0,0 --max-occluded-views 2"),
              HasSubstr("max_occluded_views: it must be less than 2, the number of views, not 2"));
  EXPECT_THAT(error("--server http://127.0.0.1:50051 check 0,0"),
              HasSubstr("is not a server address; use host:port"));
  EXPECT_THAT(error("check --file - </dev/null"), HasSubstr("-: it has no configuration"));
  const Ended unknown = cell_.Run("--server no-such-host.invalid:50051 check 0,0");
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.err, HasSubstr("no host has the name in 'no-such-host.invalid:50051'"));
}

TEST_F(Silhouette, WrongRegionsAreNamed) {
  const auto error = [&](const std::string& arguments) {
    const Ended ended = cell_.Run("region allow part " + arguments);
    EXPECT_EQ(ended.exit_code, 2) << arguments << ": " << ended.out;
    return ended.err;
  };
  EXPECT_THAT(error("'left:1,1;2,2;1,2'"), HasSubstr("--for"));
  EXPECT_THAT(error("--for 30s"), HasSubstr("say where"));
  EXPECT_THAT(error("'left:1,1;2,2;1,2' --for soon"), HasSubstr("--for: 'soon' is not a time"));
  EXPECT_THAT(error("'left:1,1;2,2;1,2' --for 5m"), HasSubstr("(units: ms, s, min, h)"));
  EXPECT_THAT(error("'left:1,1;2,2;1,2' --for 1h"), HasSubstr("at most 10 min"));
  EXPECT_THAT(error("'left:1,1;2,2;1,2' --for inf"), HasSubstr("--for: 'inf' is not a time"));
  EXPECT_THAT(error("'left:1,1;2,2' --for 1s"), HasSubstr("at least three corners"));
  EXPECT_THAT(error("'left:1,1;2,2;x,2' --for 1s"), HasSubstr("'left:1,1;2,2;x,2' is not"));
  EXPECT_THAT(error("'back:1,1;2,2;1,2' --for 1s"), HasSubstr("no such view"));
  EXPECT_THAT(error("'left:1,1;16,2;1,2' --for 1s"),
              HasSubstr("views[0] 'left'.polygon: the corner 16,2 is outside the view's mask: "
                        "corners are pixels of the mask, which has 16x16"));
  EXPECT_THAT(error("--mask left=nothing.png --for 1s"), HasSubstr("nothing.png"));
  EXPECT_THAT(error("--mask left --for 1s"), HasSubstr("VIEW=FILE"));
}

TEST_F(Silhouette, ServerThatIsGoneIsTheWorldsFailure) {
  PublishWall();
  cell_.StopServer();
  for (const char* arguments :
       {"check 0,0", "path 0,0 0,1", "space", "plan 0,0 1,0", "explain 0,0", "scene show"}) {
    const Ended ended = cell_.Run(arguments);
    EXPECT_EQ(ended.exit_code, 3) << arguments;
    EXPECT_THAT(ended.out, IsEmpty());
    EXPECT_EQ(ended.err, "silhouette: no server answers at " + cell_.address() +
                             "; start silhouette-server or use another address\n");
  }
}

TEST_F(Silhouette, PlanThatEndsWithAnErrorLeavesNoPathOfAnEarlierPlan) {
  PublishWall();
  ASSERT_EQ(cell_.Run("plan 0,0 0,1 --out path.json").exit_code, 0);
  ASSERT_EQ(cell_.Run("path --file path.json").exit_code, 0);
  cell_.StopServer();
  EXPECT_EQ(cell_.Run("plan 0,0 0,1 --out path.json").exit_code, 3);
  const Json path = Json::parse(ContentOf(cell_.shell().folder() / "path.json"));
  EXPECT_EQ(path["waypoints"], Json::array());
  EXPECT_THAT(std::string(path["outcome"]), HasSubstr("ended with an error"));
  const Ended unwritten = cell_.Run("plan 0,0 0,1 --out none/path.json");
  EXPECT_EQ(unwritten.exit_code, 2);
  EXPECT_THAT(unwritten.err, HasSubstr("none/path.json"));
}

TEST_F(Silhouette, PlanThatTheFullDiskEndsLeavesNoPathOfAnEarlierPlan) {
  PublishWall();
  ASSERT_EQ(cell_.Run("plan 0,0 0,1 --out path.json").exit_code, 0);
  // No file of any size can be written, as on a full disk.
  const Ended full =
      cell_.shell().Run("ulimit -f 0; exec " + ProgramFolder() + "/silhouette --server " +
                        cell_.address() + " plan 0,0 0,1 --out path.json 2>/dev/null");
  EXPECT_EQ(full.exit_code, 3);
  EXPECT_THAT(ContentOf(cell_.shell().folder() / "path.json"), IsEmpty());
  EXPECT_EQ(cell_.Run("path --file path.json").exit_code, 2);
}

TEST_F(Silhouette, PlanNamesAFileThatCannotBe) {
  const Ended plan = cell_.Run("plan 0,0 0,1 --out " + std::string(300, 'n'));
  EXPECT_EQ(plan.exit_code, 2);
  EXPECT_THAT(plan.err, HasSubstr("shorten it to 255 characters"));
}

TEST_F(Silhouette, PlanKeepsItsPathWhenThePictureCannotBeWritten) {
  PublishWall();
  EXPECT_EQ(cell_.Run("plan 0,0 0,1 --out path.json --picture none/space.png").exit_code, 2);
  EXPECT_EQ(cell_.Run("path --file path.json").exit_code, 0);
}

// A whole configuration space of one joint, all free.
v1::GetConfigurationSpaceResponse FreeLine() {
  v1::GetConfigurationSpaceResponse part;
  part.mutable_basis()->set_scene_id(1);
  part.mutable_basis()->mutable_valid_for()->set_seconds(60);
  v1::GridJoint& joint = *part.mutable_grid()->add_joints();
  joint.set_name("a");
  joint.set_upper(1);
  joint.set_steps(11);
  part.mutable_grid()->add_tile_edges(4096);
  v1::ConfigurationSpaceTile& tile = *part.add_tiles();
  tile.set_free(std::string(512, '\xff'));
  tile.set_occupied(std::string(512, '\0'));
  return part;
}

TEST(SilhouetteProgram, BrokenStreamIsNoSpace) {
  FakeServer server;
  server.configuration_space = [](auto&, auto&, auto& writer) {
    writer.Write(FreeLine());
    return grpc::Status(grpc::StatusCode::INTERNAL, "broke off");
  };
  const Shell shell;
  const std::string program = ProgramFolder() + "/silhouette --server " + server.address;
  const Ended space = shell.Run(program + " space --out space.csv");
  EXPECT_EQ(space.exit_code, 3);
  EXPECT_THAT(space.err, HasSubstr("broke off"));
  EXPECT_FALSE(std::filesystem::exists(shell.folder() / "space.csv"));
}

TEST(SilhouetteProgram, PlanEndsWhenTheSceneGoesStaleMeanwhile) {
  FakeServer server;
  server.get_database = [](auto&, auto&, v1::GetDatabaseResponse& response) {
    *response.mutable_grid() = FreeLine().grid();
    return grpc::Status::OK;
  };
  server.configuration_space = [](auto&, auto&, auto& writer) {
    writer.Write(FreeLine());
    return grpc::Status::OK;
  };
  int calls = 0;
  server.check_configurations = [&](auto&, const v1::CheckConfigurationsRequest& request,
                                    v1::CheckConfigurationsResponse& response) {
    response.mutable_basis()->set_scene_id(1);
    response.mutable_basis()->mutable_valid_for()->set_seconds(60);
    for (int i = 0; i < request.configurations_size(); ++i) {
      v1::Verdict& verdict = *response.add_verdicts();
      verdict.set_state(calls == 0 ? v1::Verdict::STATE_FREE : v1::Verdict::STATE_UNKNOWN);
      if (calls > 0) verdict.set_reason(v1::Verdict::REASON_SCENE_STALE);
    }
    ++calls;
    return grpc::Status::OK;
  };
  const Shell shell;
  const Ended plan =
      shell.Run(ProgramFolder() + "/silhouette --server " + server.address + " plan 0 1");
  EXPECT_EQ(plan.exit_code, 1) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("verdicts became unknown: the newest scene is older"));
  EXPECT_EQ(calls, 2);
}

TEST(SilhouetteProgram, PlanByTreesEndsWhenTheSceneGoesStaleMeanwhile) {
  FakeServer server;
  server.get_database = [](auto&, auto&, v1::GetDatabaseResponse& response) {
    response.set_images("drawn");
    *response.mutable_grid() = FreeLine().grid();
    return grpc::Status::OK;
  };
  bool stale = false;
  const auto answer = [&](v1::Basis& basis, v1::Verdict& verdict) {
    basis.set_scene_id(1);
    basis.mutable_valid_for()->set_seconds(60);
    verdict.set_state(stale ? v1::Verdict::STATE_UNKNOWN : v1::Verdict::STATE_FREE);
    if (!stale) return;
    verdict.set_reason(v1::Verdict::REASON_SCENE_STALE);
    basis.clear_defects();
    v1::SceneDefect& defect = *basis.add_defects();
    defect.set_reason(v1::Verdict::REASON_SCENE_STALE);
    defect.set_message("the newest scene is older than max_age");
  };
  server.check_configurations = [&](auto&, const v1::CheckConfigurationsRequest& request,
                                    v1::CheckConfigurationsResponse& response) {
    for (int i = 0; i < request.configurations_size(); ++i) {
      answer(*response.mutable_basis(), *response.add_verdicts());
    }
    return grpc::Status::OK;
  };
  server.check_path = [&](auto&, auto&, v1::CheckPathResponse& response) {
    stale = true;
    answer(*response.mutable_basis(), *response.mutable_verdict());
    return grpc::Status::OK;
  };
  const Shell shell;
  const Ended plan =
      shell.Run(ProgramFolder() + "/silhouette --server " + server.address + " plan 0 1");
  EXPECT_EQ(plan.exit_code, 1) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("no path: the start is unknown: the newest scene is older"));
}

TEST(SilhouetteProgram, PlanWhoseLastAnswerComesLateNamesNoPlace) {
  FakeServer server;
  server.get_database = [](auto&, auto&, v1::GetDatabaseResponse& response) {
    *response.mutable_grid() = FreeLine().grid();
    return grpc::Status::OK;
  };
  server.configuration_space = [](auto&, auto&, auto& writer) {
    writer.Write(FreeLine());
    return grpc::Status::OK;
  };
  server.check_configurations = [](auto&, const v1::CheckConfigurationsRequest& request,
                                   v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = FreeLine().basis();
    for (int i = 0; i < request.configurations_size(); ++i) {
      response.add_verdicts()->set_state(v1::Verdict::STATE_FREE);
    }
    return grpc::Status::OK;
  };
  server.check_path = [](auto&, auto&, v1::CheckPathResponse& response) {
    *response.mutable_basis() = FreeLine().basis();
    response.mutable_basis()->mutable_valid_for()->set_seconds(0);
    response.mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
    return grpc::Status::OK;
  };
  const Shell shell;
  const Ended plan =
      shell.Run(ProgramFolder() + "/silhouette --server " + server.address + " plan 0 1");
  EXPECT_EQ(plan.exit_code, 1) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("the path found is not free: unknown: the answer expired"));
}

TEST(SilhouetteProgram, HelpShowsAnExampleForEverySubcommand) {
  const Shell shell;
  for (const char* command : {"", "check", "path", "space", "watch", "scene", "scene publish",
                              "scene show", "scene live", "scene variant", "region", "region allow",
                              "region revoke", "region list", "explain", "replay", "plan"}) {
    const Ended help = shell.Run(ProgramFolder() + "/silhouette " + command + " --help");
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_THAT(help.out, HasSubstr("Example:\n  silhouette ")) << command;
  }
  EXPECT_THAT(shell.Run(ProgramFolder() + "/silhouette").exit_code, 2);
  EXPECT_THAT(shell.Run(ProgramFolder() + "/silhouette check 0 --server x").err,
              AllOf(HasSubstr("'x' is not a server address"), Not(HasSubstr("terminate"))));
}

}  // namespace
}  // namespace silhouette
