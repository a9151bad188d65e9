// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments paper as its users meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class PaperCommand : public testing::Test {
 protected:
  Ended Run(const std::string& arguments) const {
    return shell_.Run(ProgramFolder() + "/silhouette-experiments paper " + arguments);
  }

  // The default settings with 12 steps, 24 pixels and 2 scenes.
  std::string SmallSettings() const {
    std::string text = Run("--print-settings").out;
    const auto change = [&](const std::string& from, const std::string& to) {
      ASSERT_NE(text.find(from), std::string::npos) << from;
      text.replace(text.find(from), from.size(), to);
    };
    change("steps: 72", "steps: 12");
    change("pixels: 64", "pixels: 24");
    change("scenes: 200", "scenes: 2");
    change("voxels: [64, 128]", "voxels: [16]");
    const std::string path = (folder_ / "small.yaml").string();
    std::ofstream(path) << text;
    return path;
  }

  Shell shell_;
  const fs::path& folder_ = shell_.folder();
};

TEST_F(PaperCommand, JsonHasOneRowPerExperimentRobotRigRasterPresetThresholdAndNumberOfCameras) {
  const Ended outcome = Run("--settings " + SmallSettings() +
                            " --presets paper,calibrated --experiments figure7,random "
                            "--format json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto rows = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(rows.size(), 2u * 2 * 2 * 2 * 2 * 2 * 4);
  const auto& row = rows[0];
  EXPECT_EQ(row["experiment"], "figure7");
  EXPECT_EQ(row["variant"], "planar");
  EXPECT_EQ(row["rig"], "A");
  EXPECT_EQ(row["raster"], "centre");
  EXPECT_EQ(row["preset"], "paper");
  EXPECT_EQ(row["min_views"], "n");
  EXPECT_EQ(row["views"], 1);
  EXPECT_EQ(row["configurations"], 144);
  for (const char* key :
       {"additional_percent", "additional_min_percent", "additional_max_percent", "missing_percent",
        "missing_min_percent", "missing_max_percent", "occupied_percent"}) {
    EXPECT_TRUE(row[key].is_number()) << key;
  }
}

TEST_F(PaperCommand, OutGetsTablesAndFiguresThatPlotDraws) {
  const fs::path out = folder_ / "new/paper";
  const Ended outcome = Run("--settings " + SmallSettings() +
                            " --presets paper --experiments figure7 --variants planar --rigs A "
                            "--out " +
                            out.string());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("figure7, planar, rig A, centre"));
  EXPECT_THAT(ContentOf(out / "rows.csv"), HasSubstr("figure7,planar,A,touch,paper,n-1,4,"));
  const Ended plot = shell_.Run(SourceFolder() + "/tools/plot new/paper/figures.json");
  ASSERT_EQ(plot.exit_code, 0) << plot.err;
  for (const char* name : {"rows.json", "figure1.png", "figure6-planar-A.png", "views-planar-A.png",
                           "verdicts-planar-A.png"}) {
    EXPECT_GT(fs::file_size(out / name), 1000u) << name;
  }
}

TEST_F(PaperCommand, PlotDrawsTheChartsOfItsRows) {
  const fs::path out = folder_ / "charts";
  const Ended outcome = Run("--settings " + SmallSettings() +
                            " --presets paper,calibrated --variants planar --rigs A "
                            "--experiments figure7,reconstruction --out " +
                            out.string());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Ended plot = shell_.Run(SourceFolder() + "/tools/plot charts/rows.json");
  ASSERT_EQ(plot.exit_code, 0) << plot.err;
  for (const char* name : {"figure7-planar-A.png", "reconstruction-planar-A.png"}) {
    EXPECT_GT(fs::file_size(out / name), 1000u) << name;
  }
}

TEST_F(PaperCommand, TheReconstructionIsPartOfTheRunAndCanBeHadAlone) {
  const std::string selection =
      "--settings " + SmallSettings() + " --presets calibrated --variants planar --rigs A ";
  const Ended all = Run(selection + "--format json");
  ASSERT_EQ(all.exit_code, 0) << all.err;
  std::map<std::string, int> rows;
  for (const auto& row : nlohmann::json::parse(all.out)) ++rows[row["experiment"]];
  EXPECT_EQ(rows, (std::map<std::string, int>{{"figure7", 16},
                                              {"figure7_occluded", 16},
                                              {"random", 16},
                                              {"current_off_grid", 16},
                                              {"test_off_grid", 16},
                                              {"reconstruction_figure7", 16},
                                              {"reconstruction", 16}}));
  const fs::path out = folder_ / "out_of_reconstruction";
  const Ended alone = Run(selection + "--experiments reconstruction --out " + out.string());
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  EXPECT_THAT(alone.out, HasSubstr("hull-minus-robot-hull, 16 voxels in place of calibrated"));
  EXPECT_THAT(alone.out, testing::Not(HasSubstr("current_off_grid")));
}

TEST_F(PaperCommand, MistakesAreOneSentence) {
  EXPECT_EQ(Run("--experiments figure8").exit_code, 2);
  EXPECT_THAT(Run("--experiments figure8").err, HasSubstr("figure7,"));
  EXPECT_THAT(Run("--experiments figure8").err, HasSubstr("reconstruction"));
  EXPECT_EQ(Run("--rigs C").exit_code, 2);
  const Ended no_folder = Run("--out .out");
  EXPECT_EQ(no_folder.exit_code, 2);
  EXPECT_THAT(no_folder.err, HasSubstr("cannot be made"));
  EXPECT_EQ(Run("--settings " + (folder_ / "nowhere.yaml").string()).exit_code, 2);
}

}  // namespace
}  // namespace silhouette
