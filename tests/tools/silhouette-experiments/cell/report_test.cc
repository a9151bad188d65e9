// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/tools/silhouette-experiments/cell/small_workplace.h"
#include "tools/silhouette-experiments/cell/missing_picture.h"

namespace silhouette::cell_experiment {
namespace {

using testing::HasSubstr;

// Two scenes, one of which no verdict can be made on; a configuration is missing for one policy.
std::vector<SceneRecord> Records() {
  SceneRecord tested{.number = 0, .robot_on_grid = true, .tallies = {}, .missing = {}};
  tested.tallies.resize(2);
  tested.tallies[0][kOnGrid] = {.tested = 200, .occupied = 20, .additional = 30, .missing = 1};
  tested.tallies[1][kOnGrid] = {.tested = 200, .occupied = 20, .additional = 50, .missing = 0};
  MissedConfiguration missed{{0.5, -0.25}, kOnGrid, {0}};
  tested.missing.push_back({missed, {{.cause = Cause::kRim, .sentence = "Why, then."}}});
  SceneRecord refused{.number = 1, .blocked = Reason::kErrorArea, .tallies = {}, .missing = {}};
  refused.tallies.resize(2);
  return {tested, refused};
}

TEST(CellReport, RowsHaveAllKeysAndCountEverySceneOnce) {
  const SmallWorkplace small;
  const TrialSetting setting = small.Setting();
  const std::vector<Row> rows = RowsOf("random", setting, Records());
  ASSERT_EQ(rows.size(), 2u) << "nothing was tested off the grid";
  const auto json = JsonOf(rows);
  for (const auto& row : json) {
    for (const char* key : {"experiment", "seed", "preset", "min_views", "where", "scenes",
                            "refused_scenes", "tested", "occupied_percent", "additional_percent",
                            "missing_percent", "missing_count", "causes"}) {
      EXPECT_TRUE(row.contains(key)) << key;
    }
    EXPECT_EQ(row["causes"].size(), kCauses);
    EXPECT_EQ(row["scenes"], 1);
    EXPECT_EQ(row["refused_scenes"], 1);
  }
  EXPECT_EQ(json[0]["occupied_percent"], 10);
  EXPECT_EQ(json[0]["additional_percent"], 15);
  EXPECT_EQ(json[0]["missing_percent"], 0.5);
  EXPECT_EQ(json[0]["causes"]["rim"], 1);
  EXPECT_EQ(json[1]["causes"]["rim"], 0);
}

TEST(CellReport, TablesHaveALineForEveryRow) {
  const SmallWorkplace small;
  const TrialSetting setting = small.Setting();
  const std::vector<SceneRecord> records = Records();
  const std::vector<Row> rows = RowsOf("random", setting, records);
  const auto lines = [](const std::string& text) {
    return std::count(text.begin(), text.end(), '\n');
  };
  EXPECT_EQ(lines(CsvOf(rows)), 3);
  EXPECT_EQ(lines(ScenesCsvOf(setting, records)), 1 + 2 * 2 * 2);
  const std::string missing = MissingCsvOf(setting, records, {{"a.png"}, {}});
  EXPECT_EQ(lines(missing), 2);
  EXPECT_THAT(missing, HasSubstr("0,on_grid,0.5,-0.25,uncalibrated,1,rim,\"Why, then.\",a.png"));
  EXPECT_THAT(TextOf(rows), HasSubstr("random: 1 scenes, 1 more refused"));
}

TEST(CellReport, PicturesShowEveryCauseBeforeTheRest) {
  std::vector<SceneRecord> records(3);
  const auto add = [&](size_t record, Cause cause) {
    records[record].missing.push_back({{}, {{.cause = cause, .sentence = ""}}});
  };
  for (int i = 0; i < 9; ++i) add(0, Cause::kHidden);
  for (int i = 0; i < 3; ++i) add(1, Cause::kHidden);
  add(1, Cause::kContrast);
  add(2, Cause::kRim);
  const auto chosen = ChooseForPictures(records, 4);
  ASSERT_EQ(chosen.size(), 4u);
  std::vector<Cause> causes;
  for (const Chosen& each : chosen) {
    causes.push_back(records[each.record].missing[each.missing].explanations[0].cause);
  }
  EXPECT_THAT(causes, testing::UnorderedElementsAre(Cause::kHidden, Cause::kHidden,
                                                    Cause::kContrast, Cause::kRim));
  EXPECT_EQ(ChooseForPictures(records, 100).size(), 14u) << "each at most once";
}

Row RowOf(Preset preset, Where where, uint64_t additional, uint64_t missing) {
  Row row{.seed = 1,
          .experiment = "random",
          .policy = {.preset = preset},
          .min_views = 4,
          .where = where,
          .scenes = 2,
          .tally = {}};
  row.tally = {.tested = 400, .occupied = 40, .additional = additional, .missing = missing};
  return row;
}

TEST(CalibrationLoss, IsFoundLessTruthOfTheSameTests) {
  const std::vector<Row> truth = {
      RowOf(Preset::kUncalibrated, kOnGrid, 100, 9), RowOf(Preset::kCalibrated, kOnGrid, 40, 3),
      RowOf(Preset::kCalibrated, kOffGrid, 60, 0), RowOf(Preset::kSound, kOnGrid, 20, 0)};
  // In another order; the sound test cannot be served with what was found.
  const std::vector<Row> found = {RowOf(Preset::kCalibrated, kOffGrid, 56, 1),
                                  RowOf(Preset::kCalibrated, kOnGrid, 42, 1)};
  const OtherWay way{"found", "true and found"};
  const std::vector<Comparison> both = Compare(truth, found);
  ASSERT_EQ(both.size(), 2u);
  EXPECT_EQ(both[0].usual.where, kOnGrid);
  EXPECT_DOUBLE_EQ(both[0].AdditionalLoss(), 0.5);
  EXPECT_DOUBLE_EQ(both[0].MissingLoss(), -0.5);
  EXPECT_DOUBLE_EQ(both[1].AdditionalLoss(), -1);
  EXPECT_DOUBLE_EQ(both[1].MissingLoss(), 0.25);

  const auto json = JsonOf(truth, both, way);
  ASSERT_EQ(json.size(), 4u);
  EXPECT_FALSE(json[0].contains("loss")) << "needs no calibration";
  EXPECT_FALSE(json[3].contains("loss")) << "was not tested with the one found";
  EXPECT_EQ(json[1]["additional_percent"], 10);
  EXPECT_EQ(json[1]["found"]["additional_percent"], 10.5);
  EXPECT_EQ(json[1]["loss"]["additional_percent"], 0.5);
  EXPECT_EQ(json[1]["loss"]["missing_count"], -2);
  EXPECT_EQ(json[2]["loss"]["missing_percent"], 0.25);

  EXPECT_THAT(LossTextOf(both, way),
              testing::ContainsRegex("10.00 +10.50 +0.5000 +0.7500 +0.2500 +-0.5000 +-2"));
  EXPECT_THAT(LossCsvOf(both, way),
              HasSubstr("random,calibrated,4,on_grid,10.0,10.5,0.5,0.75,0.25,-0.5,-2\n"));
}

}  // namespace
}  // namespace silhouette::cell_experiment
