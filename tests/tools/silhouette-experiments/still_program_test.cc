// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments still as its users meet it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

// Its status; output goes to the files o and e.
int RunStill(const ProgramCell& files, const std::string& options) {
  const std::string line =
      absl::StrCat("'", ProgramFolder(), "/silhouette-experiments' still --cell '", files.cell(),
                   "' --database '", files.database(), "' --format json ", options, " >'",
                   files / "o", "' 2>'", files / "e", "'");
  return std::system(line.c_str());
}

nlohmann::json StillRows(const ProgramCell& files, const std::string& options) {
  EXPECT_EQ(RunStill(files, options), 0) << ReadText(files / "e");
  return nlohmann::json::parse(ReadText(files / "o"), nullptr, /*allow_exceptions=*/false);
}

// The demo's cell, whose images have noise, on a coarse grid.
TEST(StillExperimentProgram, NoiseLeavesVerdictsWithinTwoPercentAndWouldNotWithoutTheRuleOfTheRim) {
  const ProgramCell files;
  const std::string demo = SourceFolder() + "/capture/sim/cells/demo/";
  WriteText(files.cell(), absl::StrReplaceAll(ReadText(demo + "cell.yaml"),
                                              {{"simulation: ", "simulation: " + demo},
                                               {"urdf: ", "urdf: " + demo},
                                               {"max_move: 0.08", "max_move: 0.2"}}));
  const auto beyond = [&](const std::string& rim) {
    int scenes = 0;
    for (const auto& row : StillRows(files, "--scenes 30 --robots 1 --obstacles '" + demo +
                                                "obstacles.yaml' --weak-rim " + rim)) {
      EXPECT_EQ(row["scenes"], 30);
      EXPECT_GT(row["median_occupied"], 100);
      scenes += row["scenes_beyond_2_percent"].get<int>();
    }
    return scenes;
  };
  EXPECT_LE(beyond("cell"), 1) << "of 60 scenes";
  EXPECT_GT(beyond("obstacle"), 20);
}

TEST(StillExperimentProgram, WithoutNoiseNoVerdictChanges) {
  const ProgramCell files;
  const auto rows = StillRows(files, "--scenes 5 --robots 2");
  ASSERT_EQ(rows.size(), 4u) << "each robot without and with a person";
  for (const auto& row : rows) {
    EXPECT_EQ(row["scenes"], 5);
    EXPECT_EQ(row["configurations"], 45);
    EXPECT_EQ(row["median_changed"], 0);
    EXPECT_EQ(row["least_occupied"], row["most_occupied"]);
  }
  for (const size_t robot : {0u, 1u}) {
    EXPECT_EQ(rows[robot]["robot"], rows[robot + 2]["robot"]);
    EXPECT_LT(rows[robot]["median_occupied"], rows[robot + 2]["median_occupied"]) << "a person";
  }
}

TEST(StillExperimentProgram, EndsWithTheDefectsIfNoSceneHasVerdicts) {
  ProgramCell files;
  files.WriteCell(
      {{"capture:\n", "server: {view_check: {least_gain: 1.5, greatest_gain: 2}}\ncapture:\n"}});
  EXPECT_EQ(WEXITSTATUS(RunStill(files, "--scenes 5 --robots 1")), 2);
  const std::string error = ReadText(files / "e");
  EXPECT_NE(error.find("in each of 100 scenes a verdict is unknown: "), std::string::npos) << error;
  EXPECT_NE(error.find("as bright as its reference"), std::string::npos) << error;
}

}  // namespace
}  // namespace silhouette
