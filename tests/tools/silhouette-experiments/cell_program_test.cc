// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments cell as its users meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

class CellExperimentProgram : public testing::Test {
 protected:
  Outcome Run(const std::string& more) const {
    const std::string line =
        absl::StrCat("'", ProgramFolder(), "/silhouette-experiments' cell --cell '", files_.cell(),
                     "' --database '", files_.database(), "' ", more, " >'", files_ / "o", "' 2>'",
                     files_ / "e", "'");
    const int status = std::system(line.c_str());
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            .out = ReadText(files_ / "o"),
            .err = ReadText(files_ / "e")};
  }

  // The files of a folder of camera models.
  static std::vector<std::string> ViewsOf(const std::string& folder) {
    std::vector<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.path().extension() == ".cameramodel") files.push_back(entry.path().string());
    }
    return files;
  }

  ProgramCell files_;
};

TEST_F(CellExperimentProgram, CapturesMeasuresExplainsAndDraws) {
  const std::string options = "--scenes 3 --hidden 0 --off-grid 20 --seed 7 --format json";
  const Outcome first = Run(options + " --pictures 2 --out '" + files_ / "out" + "'");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const auto rows = nlohmann::json::parse(first.out);
  std::set<std::string> presets;
  for (const auto& row : rows) {
    presets.insert(row["preset"]);
    uint64_t causes = 0;
    for (const auto& [name, count] : row["causes"].items()) causes += count.get<uint64_t>();
    EXPECT_EQ(causes, row["missing_count"]) << "every missing configuration has its cause";
    EXPECT_EQ(row["seed"], 7);
  }
  for (const char* preset : {"uncalibrated", "paper", "calibrated", "paper-calibrated"}) {
    EXPECT_TRUE(presets.count(preset)) << preset;
  }
  for (const char* file : {"table.csv", "random-scenes.csv", "random-missing.csv"}) {
    EXPECT_FALSE(ReadText(files_ / "out/" + file).empty()) << file;
  }
  EXPECT_EQ(Run(options).out, first.out) << "the same seed, the same answer";
}

TEST_F(CellExperimentProgram, LeaveCountsTheStepsAwayFromAPersonAndSoundMissesNothing) {
  const Outcome outcome =
      Run("--leave 6 --presets uncalibrated,sound --least-obstacle 0.2 --format json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto rows = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(rows.size(), 6u) << "three distances, each under two presets";
  int scenes = 0;
  for (const auto& row : rows) {
    scenes += row["scenes"].get<int>();
    EXPECT_LT(row["nearest_m"], row["farthest_m"]);
    EXPECT_GT(row["occupied"], 0);
    EXPECT_LE(row["occupied"], row["tested"]);
    EXPECT_GT(row["steps"], 0);
    EXPECT_LE(row["free_steps"], row["steps"]);
    EXPECT_LE(row["wrong_steps"], row["touching_steps"]);
    EXPECT_LE(row["locked"], row["scenes"]);
    EXPECT_LE(row["stays"], row["scenes"]);
    if (row["preset"] != "sound") continue;
    EXPECT_EQ(row["missing"], 0);
    EXPECT_EQ(row["wrong_steps"], 0);
  }
  EXPECT_EQ(scenes, 12);
}

TEST_F(CellExperimentProgram, MoreViewsThatMustShowAnObstacleBlockLessAndMissMore) {
  const std::string options = "--scenes 2 --hidden 0 --off-grid 0 --pictures 0 --format json ";
  const Outcome outcome =
      Run(options + "--presets uncalibrated,sound --min-views 1,2 --least-obstacle 0.2");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto rows = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(rows.size(), 3u) << "sound asks all views";
  EXPECT_EQ(rows[0]["min_views"], 1);
  EXPECT_EQ(rows[1]["min_views"], 2);
  EXPECT_GT(rows[0]["additional_percent"], rows[1]["additional_percent"]);
  EXPECT_LE(rows[0]["missing_count"], rows[1]["missing_count"]);

  const Outcome beyond = Run(options + "--min-views 3");
  EXPECT_EQ(beyond.exit_code, 2);
  EXPECT_THAT(beyond.err, HasSubstr("min_views is 3, and the cell has 2 views"));
}

TEST_F(CellExperimentProgram,
       SmallThingsNearTheRobotHaveATableForEachSizeAndDistanceAndOneWithoutThem) {
  const Outcome outcome =
      Run("--scenes 0 --hidden 0 --near 6 --off-grid 0 --pictures 0 --format json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::set<std::string> experiments;
  for (const auto& row : nlohmann::json::parse(outcome.out)) {
    experiments.insert(row["experiment"]);
    const bool empty = row["experiment"] == "near-empty";
    EXPECT_EQ(row["scenes"].get<int>() + row["refused_scenes"].get<int>(), empty ? 6 : 1);
    EXPECT_LE(row["missing_hidden_possible"], row["missing_count"]);
    EXPECT_EQ(row["occupied_percent"] > 0, !empty) << "the thing is in the way, if there is one";
  }
  EXPECT_EQ(experiments.size(), 7u);
}

TEST_F(CellExperimentProgram, CalibrationThatWasFoundIsComparedWithTheTrueOneUnlessItContradicts) {
  const std::string options = "--scenes 2 --hidden 0 --off-grid 0 --pictures 0 --format json";
  const Outcome alone = Run(options);
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  const std::string cameras = files_ / "cameras";
  const std::string save =
      absl::StrCat("'", ProgramFolder(), "/silhouette-db' calibration export '", files_.database(),
                   "' '", cameras, "' >/dev/null");
  ASSERT_EQ(std::system(save.c_str()), 0);
  const std::string found = options + " --calibration '" + cameras + "'";
  const Outcome both = Run(found + " --out '" + files_ / "out" + "'");
  ASSERT_EQ(both.exit_code, 0) << both.err;
  auto rows = nlohmann::json::parse(both.out);
  int compared = 0;
  for (auto& row : rows) {
    if (!row.contains("loss")) continue;
    ++compared;
    // It is the true one.
    for (const auto& [name, value] : row["loss"].items()) EXPECT_EQ(value, 0) << name;
    row.erase("loss");
    row.erase("found");
  }
  EXPECT_GT(compared, 0);
  EXPECT_EQ(rows, nlohmann::json::parse(alone.out));
  EXPECT_FALSE(ReadText(files_ / "out/found-random-scenes.csv").empty());

  const std::vector<std::string> views = ViewsOf(cameras);
  ASSERT_EQ(views.size(), 2u);
  std::filesystem::rename(views[0], views[0] + ".kept");
  EXPECT_EQ(Run(found).exit_code, 2) << "a view has no camera";
  std::filesystem::copy(views[1], views[0]);
  std::filesystem::rename(views[0] + ".kept", views[1]);
  const Outcome exchanged = Run(found);
  EXPECT_EQ(exchanged.exit_code, 2);
  EXPECT_THAT(exchanged.err, HasSubstr("contradicts the robot images"));
}

TEST_F(CellExperimentProgram, DrawnRobotImagesAreComparedWithCapturedOnesOnTheSameScenes) {
  const std::string options = "--scenes 4 --hidden 0 --off-grid 20 --pictures 0 --format json";
  const Outcome alone = Run(options);
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  const Outcome both = Run(options + " --images drawn --out '" + files_ / "out" + "'");
  ASSERT_EQ(both.exit_code, 0) << both.err;
  auto rows = nlohmann::json::parse(both.out);
  for (auto& row : rows) {
    ASSERT_TRUE(row.contains("drawn")) << row;
    EXPECT_EQ(row["drawn"]["occupied_percent"], row["occupied_percent"]) << "the same tests";
    EXPECT_LE(row["loss"]["missing_count"], 0);
    row.erase("loss");
    row.erase("drawn");
  }
  EXPECT_EQ(rows, nlohmann::json::parse(alone.out));
  EXPECT_FALSE(ReadText(files_ / "out/drawn-random-scenes.csv").empty());
  EXPECT_THAT(Run("--scenes 1 --hidden 0 --pictures 0 --images drawn").out,
              HasSubstr("robot images' pixels the drawn ones lack"));
}

TEST_F(CellExperimentProgram, WhatCannotBeServedIsRefusedBeforeTheCapture) {
  const auto expect_refused = [&](const std::string& options, const std::string& message) {
    const Outcome outcome = Run(options);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(files_.database())) << options;
  };
  expect_refused("--min-views 3", "min_views is 3");
  expect_refused("--presets sound", "--least-obstacle");
  for (const char* other : {"--out o", "--scenes 1", "--hidden 1", "--near 1", "--images drawn"}) {
    expect_refused(absl::StrCat("--leave 3 ", other), "--leave");
  }
  files_.WriteCell({{"  joints:\n", "  images: drawn\n  joints:\n"},
                    {"grid:\n  steps: {joint_1: 9, joint_3: 5}\n", ""}});
  expect_refused("", "states no grid");
}

TEST_F(CellExperimentProgram, MistakesAreOneSentenceAndExitCodeTwo) {
  const auto expect_mistake = [&](const std::string& options, const std::string& message) {
    const Outcome outcome = Run(options);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(message));
  };
  expect_mistake("--presets fast", "fast");
  expect_mistake("--margin -1", "margin");
  expect_mistake("--images drawn --calibration nowhere", "--images");
  expect_mistake("--images sketched", "sketched");
  expect_mistake("--calibration nowhere", "'nowhere' is not there");
  files_.WriteCell({{"simulation: simulation.yaml\n", ""}, {"driver: sim", "driver: none"}});
  expect_mistake("--scenes 1", "cell.yaml");
}

}  // namespace
}  // namespace silhouette
