// SPDX-License-Identifier: Apache-2.0
// What is measured.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "common/numbers/numbers.h"
#include "common/yaml/strict_yaml.h"
#include "tests/folders.h"
#include "tests/test_folder.h"
#include "tests/tools/silhouette-experiments/paper/small_settings.h"
#include "tools/silhouette-experiments/paper/report.h"
#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette::paper {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

// An independent simulation of Figure 7's scene: additional and missing configurations in
// percent with one to four cameras, the paper's literal threshold.
TEST(PaperStudy, Figure7IsThatOfAnIndependentSimulation) {
  Selection selection = Everything({Experiment::kFigure7}, {Preset::kPaper});
  selection.variants = {Variant::kPlanar};
  selection.rigs = {"A"};
  const std::vector<Row> rows = Measure(ReadSettings(""), selection, 2, kGoOn);
  const double additional[2][4] = {{17.23, 2.82, 0.55, 0.12}, {21.11, 6.83, 4.61, 4.17}};
  const double missing[2][4] = {{0.256, 0.501, 0.738, 0.965}, {0, 0, 0, 0}};
  int compared = 0;
  for (const Row& row : rows) {
    if (row.threshold != Threshold::kAll) continue;
    const int touch = row.raster == Raster::kTouch ? 1 : 0;
    EXPECT_NEAR(Percent(row.additional.mean(), row.configurations),
                additional[touch][row.views - 1], 0.0051);
    EXPECT_NEAR(Percent(row.missing.mean(), row.configurations), missing[touch][row.views - 1],
                0.001);
    EXPECT_NEAR(Percent(row.occupied.mean(), row.configurations), 13.73, 0.0051);
    ++compared;
  }
  EXPECT_EQ(compared, 8);
}

TEST(PaperStudy, RowsDoNotDependOnTheNumberOfThreads) {
  const Settings settings = SmallSettings();
  const Selection selection =
      Everything(AllExperiments(), {Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated});
  const auto one = JsonOf(Measure(settings, selection, 1, kGoOn));
  const auto three = JsonOf(Measure(settings, selection, 3, kGoOn));
  EXPECT_EQ(one.size(), 5u * 2 * 2 * 2 * 3 * 2 * 4);
  EXPECT_EQ(one, three);
}

TEST(PaperStudy, MeansLieWithinTheirRanges) {
  for (const Row& row :
       Measure(SmallSettings(), Everything(AllExperiments(), {Preset::kCalibrated}), 2, kGoOn)) {
    for (const Spread& spread : {row.additional, row.missing}) {
      EXPECT_LE(static_cast<double>(spread.least), spread.mean());
      EXPECT_GE(static_cast<double>(spread.greatest), spread.mean());
    }
    EXPECT_LE(row.additional.mean() + row.occupied.mean(), static_cast<double>(row.configurations));
    EXPECT_EQ(row.scenes, row.experiment == "figure7"            ? 1
                          : row.experiment == "figure7_occluded" ? row.scenes
                                                                 : 3);
  }
}

TEST(PaperStudy, NothingSeenIsMissedWhenTheRobotIsParkedAndPixelsAreTouched) {
  for (const Row& row : Measure(
           SmallSettings(),
           Everything({Experiment::kFigure7}, {Preset::kPaper, Preset::kCalibrated}), 2, kGoOn)) {
    if (row.raster == Raster::kTouch) {
      EXPECT_EQ(row.missing.greatest, 0);
    }
  }
}

TEST(PaperStudy, TheSoundPresetsMissNothingWithAnyCamerasWhenPixelsAreTouched) {
  Settings settings = SmallSettings();
  settings.sound.edge = 0.03;
  int compared = 0;
  for (const Row& row : Measure(settings,
                                Everything({Experiment::kFigure7, Experiment::kFigure7Occluded,
                                            Experiment::kRandom, Experiment::kCurrentOffGrid},
                                           {Preset::kSoundPlanes, Preset::kSound}),
                                2, kGoOn)) {
    EXPECT_EQ(row.threshold, Threshold::kAll);
    if (row.raster != Raster::kTouch) continue;
    EXPECT_EQ(row.missing.greatest, 0) << row.experiment << ", " << row.views << " views";
    ++compared;
  }
  EXPECT_EQ(compared, 4 * 2 * 2 * 2 * 4);
}

TEST(PaperStudy, StopsWhenAskedTo) {
  EXPECT_TRUE(Measure(SmallSettings(), Everything(AllExperiments(), {Preset::kPaper}), 2,
                      [](uint64_t, uint64_t) { return false; })
                  .empty());
}

TEST(PaperStudy, ARobotParkedInTheWayIsAMistake) {
  Settings settings = SmallSettings();
  settings.parked = {2.4, 0};
  EXPECT_THAT(
      [&] { Measure(settings, Everything({Experiment::kFigure7}, {Preset::kPaper}), 1, kGoOn); },
      ThrowsMessage<std::invalid_argument>(HasSubstr("park it elsewhere")));
}

TEST(PaperSettings, TheDefaultIsTheFileThatIsShipped) {
  const Settings shipped =
      ReadSettings(SourceFolder() + "/tools/silhouette-experiments/paper/paper.yaml");
  const Settings built_in = ReadSettings("");
  EXPECT_EQ(shipped.random.count, 200);
  EXPECT_EQ(shipped.random.count, built_in.random.count);
  EXPECT_EQ(shipped.rigs.size(), built_in.rigs.size());
}

TEST(PaperSettings, MistakesAreToldWithTheirPlace) {
  std::string text = DefaultSettingsText();
  const auto expect = [&](const std::string& right, const std::string& wrong,
                          const std::string& message) {
    std::string changed = text;
    ASSERT_NE(changed.find(right), std::string::npos) << right;
    changed.replace(changed.find(right), right.size(), wrong);
    const std::string path = (TestFolder() / "settings.yaml").string();
    std::ofstream(path) << changed;
    EXPECT_THAT([&] { ReadSettings(path); }, ThrowsMessage<YamlError>(HasSubstr(message)));
  };
  expect("steps: 72", "step: 72", "steps");
  expect("steps: 72", "steps: 2", "must be from 3");
  expect("pixels: 64", "pixels: 5000", "must be from 8");
  expect("[0, 0, -1], [1, 0, 0]", "[0, 0, -1], [0, 0, 1]", "look along the same line");
  expect("voxels: [64, 128]", "voxels: [64, 500]", "must be from 8 to 256");
  expect("radius: [0.06, 0.20]", "radius: [0.3, 0.20]", "must not be above");
}

}  // namespace
}  // namespace silhouette::paper
