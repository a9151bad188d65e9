// SPDX-License-Identifier: Apache-2.0
// The study of §2: reconstruction beside the image-based tests.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "common/result/result.h"
#include "tests/tools/silhouette-experiments/paper/small_settings.h"
#include "tools/silhouette-experiments/paper/reconstruction.h"
#include "tools/silhouette-experiments/paper/report.h"

namespace silhouette::paper {
namespace {

using testing::HasSubstr;

Settings Small() {
  Settings settings = SmallSettings();
  settings.reconstruction = {.voxels = {24, 48}, .scenes = 3};
  return settings;
}

const std::vector<Row>& Rows() {
  static const std::vector<Row> rows =
      CompareWithReconstruction(Small(), Everything({}, AllPresets()), 2, kGoOn);
  return rows;
}

TEST(Reconstruction, HasARowPerExperimentRobotRigMethodAndNumberOfCameras) {
  // Three hulls with two sizes of voxels, four presets.
  EXPECT_EQ(Rows().size(), 2u * 2 * 2 * (3 * 2 + 4) * 4);
  for (const Row& row : Rows()) {
    EXPECT_EQ(row.scenes, row.experiment == "reconstruction_figure7" ? 1 : 3);
    EXPECT_EQ(row.configurations, 144);
    EXPECT_EQ(row.times.has_value(), row.views == 4);
    EXPECT_LE(row.additional.mean() + row.occupied.mean(), 144);
  }
}

TEST(Reconstruction, TheCollisionTestSaysWhatTheTestOfAllConfigurationsAtOnceSays) {
  for (const Row& row : Rows()) EXPECT_EQ(row.disagreements, 0) << row.method;
}

TEST(Reconstruction, ABodyTakenOutOfTheHullLeavesWhatBlocksItAndMissesNothing) {
  for (const Row& row : Rows()) {
    if (row.method != "hull-minus-body") continue;
    EXPECT_EQ(row.missing.greatest, 0);
    EXPECT_EQ(row.additional.mean() + row.occupied.mean(), 144);
  }
}

TEST(Reconstruction, MissesNothingOfAnUnoccludedScene) {
  for (const Row& row : Rows()) {
    if (row.experiment == "reconstruction_figure7") {
      EXPECT_EQ(row.missing.greatest, 0) << row.method;
    }
  }
}

// What the hull of obstacle pixels, in voxels no larger than pixels, calls occupied is seen as an
// obstacle in every view; with one camera as with more.
TEST(Reconstruction, FinerVoxelsBlockNoMore) {
  std::map<std::string, double> coarse;
  const auto key = [](const Row& row) {
    return row.experiment + NameOf(row.variant) + row.rig + row.method + std::to_string(row.views);
  };
  for (const Row& row : Rows()) {
    if (row.voxels == 24) coarse[key(row)] = row.additional.mean();
  }
  for (const Row& row : Rows()) {
    if (row.voxels == 48) {
      EXPECT_LE(row.additional.mean(), coarse.at(key(row))) << row.method;
    }
  }
}

TEST(Reconstruction, ButForTheTimesRowsDoNotDependOnTheNumberOfThreads) {
  const auto without_times = [](const std::vector<Row>& rows) {
    nlohmann::ordered_json array = JsonOf(rows);
    for (auto& row : array) {
      for (const char* key : {"prepare_ms", "space_ms", "check_us"}) row.erase(key);
    }
    return array;
  };
  EXPECT_EQ(without_times(Rows()), without_times(CompareWithReconstruction(
                                       Small(), Everything({}, AllPresets()), 1, kGoOn)));
}

TEST(Reconstruction, JsonHasTheKeysOfTheOtherExperimentsAndTheTimes) {
  Selection selection = Everything({}, AllPresets());
  selection.experiments = {Experiment::kFigure7};
  const auto others = JsonOf(Measure(Small(), selection, 2, kGoOn));
  const auto rows = JsonOf(Rows());
  for (const auto& row : rows) {
    for (const auto& [key, value] : others[0].items()) {
      ASSERT_TRUE(row.contains(key)) << key;
      EXPECT_EQ(row[key].type() == nlohmann::json::value_t::string,
                value.type() == nlohmann::json::value_t::string)
          << key;
    }
  }
  EXPECT_EQ(rows[3]["preset"], "hull-minus-body");
  EXPECT_EQ(rows[3]["voxels"], 24);
  EXPECT_EQ(rows[3]["views"], 4);
  for (const char* key : {"prepare_ms", "space_ms", "check_us"}) EXPECT_GT(rows[3][key], 0) << key;
}

TEST(Reconstruction, CsvHasAColumnForEveryKeyAndLeavesTheUnknownEmpty) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  rows.push_back({{"preset", "paper"}, {"views", 1}});
  rows.push_back({{"preset", "hull"}, {"check_us", 0.5}, {"views", 2}});
  EXPECT_EQ(CsvOf(rows), "preset,views,check_us\npaper,1,\nhull,2,0.5\n");
}

Row RowOf(const std::string& method, int voxels, int64_t additional, int64_t missing,
          MethodTimes times) {
  Row row;
  row.experiment = "reconstruction";
  row.rig = "A";
  row.method = method;
  row.voxels = voxels;
  row.views = 4;
  row.scenes = 1;
  row.configurations = 1000;
  row.occupied.Add(200);
  row.additional.Add(additional);
  row.missing.Add(missing);
  row.times = times;
  return row;
}

TEST(Reconstruction, TheConclusionIsThatOfTheNumbers) {
  const std::vector<Row> rows = {
      RowOf("hull-minus-body", 64, 800, 0, {1e-3, 1, 1e-6}),
      RowOf("hull-minus-body", 128, 600, 0, {8e-3, 1, 1e-6}),
      RowOf("hull-minus-robot-hull", 128, 300, 5, {8e-3, 1, 1e-6}),
      RowOf("calibrated", 0, 320, 5, {1e-5, 1, 2e-6}),
  };
  const std::string text = ConclusionOf(rows);
  EXPECT_THAT(text, HasSubstr("blocks 75.0 % of the free"));
  EXPECT_THAT(text, HasSubstr("2.000 points fewer additional, as many missing"));
  EXPECT_THAT(text, HasSubstr("800 times the time per scene, 0.5 times per configuration"));
  // 8 ms - 0.01 ms against 2 us - 1 us.
  EXPECT_THAT(text, HasSubstr("images are faster for up to 7990 configurations per scene"));
  EXPECT_THAT(text, testing::Not(HasSubstr("in place of paper:")));
  EXPECT_EQ(ConclusionOf({}), "");
}

TEST(Reconstruction, StopsWhenAskedTo) {
  EXPECT_TRUE(
      CompareWithReconstruction(Small(), Everything({}, AllPresets()), 2, [](uint64_t, uint64_t) {
        return false;
      }).empty());
}

}  // namespace
}  // namespace silhouette::paper
