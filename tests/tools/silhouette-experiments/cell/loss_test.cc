// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace silhouette::cell_experiment {
namespace {

using testing::HasSubstr;

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
  const std::vector<Comparison> both = Compare(truth, found);
  ASSERT_EQ(both.size(), 2u);
  EXPECT_EQ(both[0].truth.where, kOnGrid);
  EXPECT_DOUBLE_EQ(both[0].AdditionalLoss(), 0.5);
  EXPECT_DOUBLE_EQ(both[0].MissingLoss(), -0.5);
  EXPECT_DOUBLE_EQ(both[1].AdditionalLoss(), -1);
  EXPECT_DOUBLE_EQ(both[1].MissingLoss(), 0.25);

  const auto json = JsonOf(truth, both);
  ASSERT_EQ(json.size(), 4u);
  EXPECT_FALSE(json[0].contains("loss")) << "needs no calibration";
  EXPECT_FALSE(json[3].contains("loss")) << "was not tested with the one found";
  EXPECT_EQ(json[1]["additional_percent"], 10);
  EXPECT_EQ(json[1]["found"]["additional_percent"], 10.5);
  EXPECT_EQ(json[1]["loss"]["additional_percent"], 0.5);
  EXPECT_EQ(json[1]["loss"]["missing_count"], -2);
  EXPECT_EQ(json[2]["loss"]["missing_percent"], 0.25);

  EXPECT_THAT(LossTableOf(both), HasSubstr("|      10.00   10.50  +0.5000 |   0.7500   0.2500  "
                                           "-0.5000     -2\n"));
  EXPECT_THAT(LossCsvOf(both),
              HasSubstr("random,calibrated,4,on_grid,10,10.5,0.5,0.75,0.25,-0.5,-2\n"));
}

}  // namespace
}  // namespace silhouette::cell_experiment
