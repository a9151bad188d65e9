// SPDX-License-Identifier: Apache-2.0
// The parts of the program `silhouette` that need no server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "common/picture/palette.h"
#include "tests/shell.h"
#include "tests/test_folder.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/formats/pictures.h"
#include "tools/silhouette/formats/truth.h"

namespace silhouette {
namespace {

using client::ConfigurationSpace;
using ::testing::AllOf;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi;
constexpr AngleUnit kRadians = AngleUnit::kRadians;
constexpr AngleUnit kDegrees = AngleUnit::kDegrees;

TEST(ConfigurationText, ValuesCarryTheirUnitOrTakeTheGivenOne) {
  EXPECT_EQ(ParseJointValue("0.5", kRadians), 0.5);
  EXPECT_EQ(ParseJointValue(" -.5", kRadians), -0.5);
  EXPECT_NEAR(ParseJointValue("-90deg", kRadians), -kPi / 2, 1e-15);
  EXPECT_NEAR(ParseJointValue("90", kDegrees), kPi / 2, 1e-15);
  EXPECT_EQ(ParseJointValue("0.2m", kDegrees), 0.2);
  EXPECT_DOUBLE_EQ(ParseJointValue("-50 mm", kDegrees, true), -0.05);
  EXPECT_DOUBLE_EQ(ParseJointValue("20cm", kRadians, true), 0.2);
  EXPECT_EQ(ParseJointValue("1.5rad", kDegrees), 1.5);
  EXPECT_THAT(ParseConfiguration("0.1,180deg"), ElementsAre(0.1, DoubleNear(kPi, 1e-15)));
  EXPECT_EQ(ParseJoint("axis_1=-2", kRadians), std::pair(std::string("axis_1"), -2.0));
}

TEST(ConfigurationText, UnitMustBeOneOfTheJoint) {
  EXPECT_EQ(ParseJointValue("0.8", kDegrees, true), 0.8) << "metres, though angles are degrees";
  EXPECT_EQ(ParseJointValue("0.8m", kRadians, true), 0.8);
  EXPECT_NEAR(ParseJointValue("90", kDegrees, false), kPi / 2, 1e-15);
  for (const char* angle : {"30deg", "0.5rad", "0.5 rad"}) {
    EXPECT_THROW(ParseJointValue(angle, kRadians, true), std::invalid_argument) << angle;
  }
  EXPECT_THROW(ParseJointValue("0.2m", kRadians, false), std::invalid_argument);
}

TEST(SeparationText, SaysHowLongALevelHoldsAndStopAfterwards) {
  client::PathCheck check;
  check.basis.scene_id = 1;
  check.verdict.state = client::State::kFree;
  const auto now = client::RunningClock::now();
  check.separation = client::Separation{.level = 2,
                                        .level_name = "fast",
                                        .distance = 3,
                                        .valid_until = now + std::chrono::minutes(10)};
  EXPECT_THAT(Spoken(check), HasSubstr("; speed level 2 'fast' for "));
  check.separation->valid_until = now;
  EXPECT_THAT(Spoken(check), HasSubstr("; stop: the answer expired before it came"));
  const Json json = JsonOf(check, client::Clearance::kOmit)["separation"];
  EXPECT_EQ(json["level"], 0);
  EXPECT_EQ(json["unknown_reason"], "answer late");
}

TEST(TypedJoints, AskForTheGridOnceAndOnlyWhereAUnitMatters) {
  int asked = 0;
  const auto database = [&] {
    ++asked;
    v1::GetDatabaseResponse response;
    for (const char* name : {"rail", "turn", "other"}) {
      response.mutable_grid()->add_joints()->set_name(name);
    }
    response.mutable_grid()->mutable_joints(0)->set_slides(true);
    response.mutable_grid()->mutable_joints(1)->set_slides(false);
    return absl::StatusOr<v1::GetDatabaseResponse>(response);
  };
  TypedJoints plain(kRadians, database);
  EXPECT_THAT(*plain.Parse("0.8,1,2"), ElementsAre(0.8, 1, 2));
  EXPECT_EQ(asked, 0);
  EXPECT_THAT(std::string(plain.Parse("30deg,0,0").status().message()),
              HasSubstr("'30deg' is an angle, but the joint slides"));
  EXPECT_THAT(std::string(plain.ParseNamed("turn=0.2m").status().message()),
              HasSubstr("'0.2m' is a length, but the joint turns"));
  EXPECT_EQ(plain.ParseNamed("gripper=0.2m")->second, 0.2) << "no joint of the grid";
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(plain.Spoken("0.8, 1,90deg"), "0.8,1,90deg");

  TypedJoints degrees(kDegrees, database);
  EXPECT_THAT(*degrees.Parse("0.8,180,180"),
              ElementsAre(0.8, DoubleNear(kPi, 1e-15), DoubleNear(kPi, 1e-15)));
  EXPECT_EQ(degrees.ParseNamed("rail=0.8")->second, 0.8);
  EXPECT_EQ(asked, 2);
  EXPECT_EQ(degrees.Spoken("0.8,180,1rad"), "0.8m,180deg,1rad");

  TypedJoints unreachable(kDegrees, [] { return absl::UnavailableError("no server"); });
  EXPECT_EQ(unreachable.Parse("0.8,1,2").status().code(), absl::StatusCode::kUnavailable);
}

TEST(ConfigurationText, WhatIsNoValueIsNamed) {
  for (const char* text :
       {"", "x", "1,", ",1", "nan", "inf", "0x10", "1;2", "deg", "1 2", "1radm", "1mdeg"}) {
    EXPECT_THROW(ParseConfiguration(text), std::invalid_argument) << text;
  }
  EXPECT_THROW(ParseJoint("axis_1", kRadians), std::invalid_argument);
  EXPECT_THROW(ParseJoint("=1", kRadians), std::invalid_argument);
  try {
    ParseConfiguration("0.1,abc");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("'abc'"));
  }
}

TEST(ConfigurationText, DegreesAreAskedForWhereRadiansTurnTooOften) {
  EXPECT_EQ(DegreesHint(std::vector<double>{3, -12}), "");
  EXPECT_EQ(DegreesHint(std::vector<double>{1e308}), "");
  EXPECT_EQ(DegreesHint(std::vector<double>{0, -90}, ", or stop"),
            " (joint values are radians; did you mean degrees? Write 90deg, or stop)");
}

TEST(ConfigurationText, DegreesAreNotAskedForWhereAJointSlides) {
  const std::vector<std::optional<bool>> slides = {true, false};
  EXPECT_EQ(DegreesHint(std::vector<double>{90, 0}, "", slides), "");
  EXPECT_NE(DegreesHint(std::vector<double>{0, 90}, "", slides), "");
  TypedJoints joints(kRadians, [] {
    v1::GetDatabaseResponse database;
    database.mutable_grid()->add_joints()->set_slides(true);
    database.mutable_grid()->add_joints();
    return database;
  });
  ASSERT_TRUE(joints.Parse("90,0").ok());
  EXPECT_THAT(joints.Slides(), ElementsAre(std::optional(true), std::nullopt));
}

TEST(ConfigurationText, FileHasAConfigurationPerLine) {
  const Shell shell;
  const std::string file = (shell.folder() / "list.txt").string();
  WriteFile(file, "\xef\xbb\xbf# two\n0.1, 0.2\n\n 90deg\t1  # second\n");
  TypedJoints joints(kRadians, [] { return v1::GetDatabaseResponse(); });
  const auto read = ReadConfigurations(file, joints);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 2u);
  EXPECT_THAT((*read)[1], ElementsAre(DoubleNear(kPi / 2, 1e-15), 1));
  WriteFile(file, "0.1,0.2\n0.1,?\n");
  const absl::Status status = ReadConfigurations(file, joints).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr(file + ":2"), HasSubstr("'?'")));
  WriteFile(file, "# none\n");
  const absl::Status none = ReadConfigurations(file, joints).status();
  EXPECT_EQ(none.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(none.message()), HasSubstr(file + ": it has no configuration"));
}

TEST(ConfigurationText, APathOfOtherJointsIsNotThatOfTheCell) {
  const auto path = ParsePath(R"({"joints": ["b", "a"], "waypoints": [[0.1, 0.2]]})", "path.json");
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_TRUE(RequireJoints(*path, {"b", "a"}).ok());
  EXPECT_EQ(RequireJoints(*path, {"a", "b"}),
            absl::InvalidArgumentError("path.json: the path is of the joints b, a, and the cell's "
                                       "configurations are of a, b, in this order"));
}

TEST(ConfigurationText, WaypointsComeFromJson) {
  const Shell shell;
  const std::string file = (shell.folder() / "path.json").string();
  WriteFile(file, R"({"waypoints": [[0.1, 0.2], [0.3, 0.2]], "more": 1})");
  const auto read = ReadPath(file);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->waypoints.at(1), (Configuration{0.3, 0.2}));
  EXPECT_TRUE(RequireJoints(*read, {"a", "b"}).ok());
  for (const char* wrong : {"[", "[]", "{}", R"({"waypoints": []})", R"({"waypoints": [["a"]]})",
                            R"({"joints": 2, "waypoints": [[0.1, 0.2]]})"}) {
    WriteFile(file, wrong);
    const absl::Status status = ReadPath(file).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << wrong;
    EXPECT_THAT(std::string(status.message()), HasSubstr(file));
  }
}

TEST(ImagesFolder, IsReadWithTimeJointsAndViews) {
  const Shell shell;
  WriteFile(shell.folder() / "images.json",
            R"({"time": "2026-01-31T12:00:00.5Z", "joints": {"b": 0.5, "a": -1},
                "views": {"top": "top.png", "left": "sub/left.png"}})");
  const auto images = ReadImagesFolder(shell.folder().string());
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->time, absl::FromUnixMillis(1769860800500));
  ASSERT_EQ(images->joints.size(), 2u);
  EXPECT_EQ(images->joints[0].first, "b");
  EXPECT_EQ(images->joints[1].second, -1);
  ASSERT_EQ(images->images.size(), 2u);
  EXPECT_EQ(images->images[1].path, (shell.folder() / "sub/left.png").string());
}

TEST(ImagesFolder, MistakesAreNamedWithTheirKey) {
  const Shell shell;
  const auto message = [&](const std::string& json) {
    WriteFile(shell.folder() / "images.json", json);
    const absl::Status status = ReadImagesFolder(shell.folder().string()).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << json;
    EXPECT_THAT(std::string(status.message()), HasSubstr("images.json"));
    return std::string(status.message());
  };
  EXPECT_THAT(message("nonsense"), HasSubstr("not JSON"));
  EXPECT_THAT(message("[]"), HasSubstr("object"));
  EXPECT_THAT(message("{}"), HasSubstr("'views'"));
  EXPECT_THAT(message(R"({"views": ["a"]})"), HasSubstr("'views'"));
  EXPECT_THAT(message(R"({"views": {"top": 1}})"), HasSubstr("'top'"));
  EXPECT_THAT(message(R"({"views": {"top": "a"}, "joints": {"a": "x"}})"), HasSubstr("'a'"));
  EXPECT_THAT(message(R"({"views": {"top": "a"}, "time": "noon"})"), HasSubstr("'time'"));
  EXPECT_EQ(ReadImagesFolder((shell.folder() / "none").string()).status().code(),
            absl::StatusCode::kNotFound);
}

// Two joints of three values each.
ConfigurationGrid SmallGrid() {
  return ConfigurationGrid({{.name = "a", .lower = 0, .upper = 2, .steps = 3},
                            {.name = "b", .lower = 0, .upper = 2, .steps = 3}});
}

std::string TruthOf(const ConfigurationGrid& grid, const std::vector<int>& contacts) {
  std::string text = "number,a,b,contact,distance\n";
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      text += std::to_string(grid.NumberOf({a, b})) + "," + std::to_string(a) + "," +
              std::to_string(b) + "," + std::to_string(contacts[static_cast<size_t>(3 * a + b)]) +
              ",0.1\n";
    }
  }
  return text;
}

TEST(Truth, JudgesEveryConfiguration) {
  const Shell shell;
  const std::string file = (shell.folder() / "truth.csv").string();
  const ConfigurationGrid grid = SmallGrid();
  WriteFile(file, TruthOf(grid, {1, 1, 1, 1, 0, 0, 0, 0, 0}));
  const auto truth = Truth::Read(file, grid);
  ASSERT_TRUE(truth.ok()) << truth.status();
  client::ConfigurationSpaceTile tile;
  const auto set = [&](client::TileBits& bits, int a, int b) {
    const ConfigurationNumber number = grid.NumberOf({a, b});
    bits[number / 64] |= uint64_t{1} << (number % 64);
  };
  set(tile.free, 0, 0);      // missing
  set(tile.occupied, 0, 1);  // right; (0,2) and (1,0) are unknown
  set(tile.occupied, 1, 1);  // additional
  set(tile.occupied, 1, 2);  // additional
  set(tile.occupied, 2, 0);  // additional
  set(tile.free, 2, 1);      // right; (2,2) is unknown
  const Judgement judgement = Judge(ConfigurationSpace(grid, {.scene_id = 1}, {tile}), *truth);
  EXPECT_EQ(judgement.configurations, 9u);
  EXPECT_EQ(judgement.occupied_in_truth, 4u);
  EXPECT_EQ(judgement.missing, 1u);
  EXPECT_EQ(judgement.additional, 3u);
  EXPECT_EQ(judgement.unknown, 3u);
}

TEST(Truth, OfAnotherGridOrBrokenIsRefused) {
  const Shell shell;
  const std::string file = (shell.folder() / "truth.csv").string();
  const ConfigurationGrid grid = SmallGrid();
  const std::string good = TruthOf(grid, std::vector<int>(9, 0));
  const auto message = [&](const std::string& text) {
    WriteFile(file, text);
    const absl::Status status = Truth::Read(file, grid).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << text;
    return std::string(status.message());
  };
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_THAT(message(""), HasSubstr(":1: the column 'number'"));
  EXPECT_THAT(message(replaced("contact", "touch")), HasSubstr("'contact'"));
  EXPECT_THAT(message(replaced(",b,", ",c,")), HasSubstr("'b'"));
  EXPECT_THAT(message(replaced("\n0,0,0,0", "\n0,0,0,2")), HasSubstr(":2: contact"));
  EXPECT_THAT(message(replaced("\n0,0,0,0", "\n0,0,0.5,0")), HasSubstr("another grid"));
  EXPECT_THAT(message(replaced("\n0,0,0,0", "\n4095,0,0,0")), HasSubstr("no configuration 4095"));
  EXPECT_THAT(message(good + "0,0,0,0,0\n"), HasSubstr("comes twice"));
  EXPECT_THAT(message(good.substr(0, good.rfind('\n', good.size() - 2) + 1)),
              HasSubstr("has 8 of 9"));
}

TEST(SpacePicture, HasACellPerConfigurationInItsState) {
  const ConfigurationGrid grid = SmallGrid();
  client::ConfigurationSpaceTile tile;
  const ConfigurationNumber number = grid.NumberOf({2, 1});
  tile.occupied[number / 64] |= uint64_t{1} << (number % 64);
  const auto chart = ChartOf(ConfigurationSpace(grid, {.scene_id = 1}, {tile}), {}, "title");
  ASSERT_TRUE(chart.ok());
  EXPECT_EQ(chart->x.label, "a");
  EXPECT_NEAR(chart->x.last, 2 * 180 / kPi, 1e-9);
  EXPECT_THAT(chart->cells, ElementsAre(0, 0, 0, 0, 0, kOccupiedCell, 0, 0, 0));
}

TEST(SpacePicture, AxisOfAJointThatSlidesIsInMetres) {
  const ConfigurationGrid grid = SmallGrid();
  const std::vector<std::optional<bool>> slides = {true, false};
  const auto chart = ChartOf(ConfigurationSpace(grid, {.scene_id = 1}, {}), slides, "title");
  ASSERT_TRUE(chart.ok());
  EXPECT_EQ(chart->x.unit, "m");
  EXPECT_EQ(chart->x.last, 2);
  EXPECT_EQ(chart->y.unit, "deg");
  const ChartPoint place = ChartPointOf({.grid = grid, .slides = slides}, {0.5, kPi});
  EXPECT_EQ(place.x, 0.5);
  EXPECT_NEAR(place.y, 180, 1e-9);
}

TEST(SpacePicture, FreeCellsAreShadedByTheLevelThatTheyExceed) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 3, .steps = 4},
                                {.name = "b", .lower = 0, .upper = 0, .steps = 1}},
                               {64, 64});
  client::ConfigurationSpaceTile tile;
  tile.above.resize(2);
  // (0, 0) is unknown, the others exceed none, one and both of the levels.
  for (int a = 1; a < 4; ++a) {
    const ConfigurationNumber number = grid.NumberOf({a, 0});
    const uint64_t bit = uint64_t{1} << (number % 64);
    tile.free[number / 64] |= bit;
    if (a > 1) tile.above[0][number / 64] |= bit;
    if (a > 2) tile.above[1][number / 64] |= bit;
  }
  const auto chart =
      ChartOf(ConfigurationSpace(grid, {.scene_id = 1}, {tile}, 0, {1, 2.5}), {}, "title");
  ASSERT_TRUE(chart.ok());
  EXPECT_THAT(chart->cells, ElementsAre(0, 2, 3, 4));
  std::vector<std::string> texts;
  for (const LegendEntry& entry : chart->classes) texts.push_back(entry.text);
  EXPECT_THAT(texts, ElementsAre("unknown", "occupied", "free, clearance up to 1 px", "above 1 px",
                                 "above 2.5 px"));
  EXPECT_EQ(chart->classes[2].colour, palette::kTight);
  EXPECT_EQ(chart->classes[4].colour, palette::kFree);
}

// Where a picture has a colour: its first and last column and row.
cv::Rect Extent(const cv::Mat& picture, Colour colour) {
  cv::Mat mask;
  cv::inRange(picture, BgrOf(colour), BgrOf(colour), mask);
  return cv::boundingRect(mask);
}

TEST(ExplanationPicture, HasTheRobotsOutlineInTheShapeOfTheCameraImage) {
  const auto folder = FreshFolder();
  cv::imwrite((folder / "camera.png").string(), cv::Mat(90, 160, CV_8UC3, cv::Scalar(9, 9, 9)));
  client::Explanation explanation;
  explanation.verdict.state = client::State::kOccupied;
  client::ViewPictures& view = explanation.views.emplace_back();
  view.view = "top";
  // The right lower quarter of a square mask.
  view.robot = Mask::FromPredicate({16, 16}, [](int x, int y) { return x >= 8 && y >= 8; });
  ExplanationNotes notes{.lines = {"Configuration: 30deg"},
                         .shapes = {{"top", 9.0 / 16}},
                         .cameras = {{"top", (folder / "camera.png").string()}}};
  ASSERT_TRUE(WriteExplanation(explanation, notes, folder.string()).ok());
  const cv::Mat sheet = cv::imread((folder / "explanation.png").string());
  const cv::Rect camera = Extent(sheet, {9, 9, 9});
  EXPECT_NEAR(camera.width, 256, 1);
  EXPECT_NEAR(camera.height, 144, 1);
  const cv::Rect outline = Extent(sheet(camera), palette::kRobot);
  EXPECT_NEAR(outline.x, 128, 1);
  EXPECT_NEAR(outline.y, 72, 1);

  notes.cameras["top"] = (folder / "nothing.png").string();
  EXPECT_FALSE(WriteExplanation(explanation, notes, folder.string()).ok());
}

TEST(SpacePicture, NeedsTwoJoints) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 2, .steps = 3}});
  const auto chart = ChartOf(ConfigurationSpace(grid, {.scene_id = 1}, {}), {}, "");
  EXPECT_EQ(chart.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(chart.status().message()), HasSubstr("2 joints"));
}

TEST(SpacePicture, PathOverTheRimOfAContinuousJointIsDrawnInPieces) {
  const ConfigurationGrid grid(
      {{.name = "a", .lower = 0, .upper = 2 * kPi, .steps = 36, .continuous = true},
       {.name = "b", .lower = 0, .upper = 2, .steps = 3}});
  const auto degrees = [](double a, double b) {
    return Configuration{a * kPi / 180, b * kPi / 180};
  };
  // The chart goes from -5 to 355 degrees.
  const std::vector<std::optional<bool>> unknown;
  const ChartedJoints charted{.grid = grid, .slides = unknown};
  const auto lines = ChartLines(charted, {degrees(300, 10), degrees(340, 10), degrees(370, 40)});
  ASSERT_EQ(lines.size(), 2u);
  const ChartPoint out = lines[0].back();
  EXPECT_NEAR(out.x, 355, 1e-9);
  EXPECT_NEAR(out.y, 25, 1e-9);
  const ChartPoint in = lines[1].front();
  EXPECT_NEAR(in.x, -5, 1e-9);
  EXPECT_NEAR(in.y, 25, 1e-9);
  EXPECT_NEAR(lines[1].back().x, 10, 1e-9);
  EXPECT_EQ(ChartLines(charted, {degrees(300, 10), degrees(320, 10)}).size(), 1u);
  EXPECT_NEAR(ChartPointOf(charted, degrees(-30, 0)).x, 330, 1e-9);
}

TEST(Output, SaysWhyAVerdictIsUnknownAndWhereAnObstacleMayHide) {
  EXPECT_EQ(Spoken(client::Verdict{.state = client::State::kFree}, {}), "free");
  EXPECT_THAT(Spoken(client::Verdict{.reason = client::Reason::kNoScene}, {}),
              HasSubstr("unknown: the server has no scene"));
  EXPECT_THAT(Spoken(client::Verdict{.state = client::State::kFree, .hidden_possible = true}, {}),
              HasSubstr("may hide"));
  EXPECT_EQ(JsonOf(client::Verdict{})["state"], "unknown");
  EXPECT_TRUE(JsonOf(client::Basis{})["scene_id"].is_null());
  EXPECT_EQ(Spoken(client::Basis{}), "no scene, database generation 0");
  const client::Basis stale{
      .scene_id = 3,
      .defects = {{client::Reason::kSceneStale, "camera 'left' does not serve: cable pulled"},
                  {client::Reason::kViewMissing, "view 'left' is missing"}}};
  EXPECT_EQ(Spoken(client::Verdict{.reason = client::Reason::kSceneStale}, stale),
            "unknown: camera 'left' does not serve: cable pulled");
  EXPECT_THAT(Spoken(stale), HasSubstr("; view 'left' is missing"));
}

TEST(Output, TableAlignsItsColumns) {
  EXPECT_EQ(TextOf(Table{.headings = {"view", "a"}, .rows = {{"x", "100"}}}),
            "view    a\nx     100\n");
  EXPECT_EQ(TextOf(Table{.headings = {}, .rows = {{"view", "a"}, {"x", "100"}}}),
            "view    a\nx     100\n");
}

}  // namespace
}  // namespace silhouette
