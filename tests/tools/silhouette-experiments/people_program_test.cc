// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments people as its users meet it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

class PeopleProgram : public testing::Test {
 protected:
  // The exit code of two seconds; output goes to the files o and e. Coarse voxels take no time.
  int Run(const std::string& more, double least_obstacle = 0.5) const {
    const std::string line = absl::StrCat(
        "'", ProgramFolder(), "/silhouette-experiments' people --cell '", files_.cell(),
        "' --database '", files_.database(), "' --seconds 2 --format json --least-obstacle ",
        least_obstacle, " ", more, " >'", files_ / "o", "' 2>'", files_ / "e", "'");
    return WEXITSTATUS(std::system(line.c_str()));
  }

  ProgramCell files_;
};

TEST_F(PeopleProgram, FilmsARenderedEpisode) {
  const std::string video = files_ / "people.avi";
  ASSERT_EQ(Run("--masks rendered --episodes 1 --methods uncalibrated --video '" + video + "'"), 0)
      << ReadText(files_ / "e");
  EXPECT_GT(std::filesystem::file_size(video), 10'000u);
  const auto method = nlohmann::json::parse(ReadText(files_ / "o"))["methods"][0];
  EXPECT_EQ(method["scenes"], 40) << "20 a second";
  EXPECT_EQ(method["unusable_scenes"], 0);
}

TEST_F(PeopleProgram, GoesOnOnlyWithResultsOfTheSameLeastObstacleRobotModelAndCellFile) {
  const std::string source = SourceFolder() + "/capture/sim/robots/rx130.urdf";
  const std::string model = files_ / "robot.urdf";
  WriteText(model, ReadText(source));
  files_.WriteCell({{source, model}});
  const std::string study =
      absl::StrCat("--images drawn --episodes 1 --methods light_curtain --out '", files_ / "", "'");
  const auto expect_refused = [&](double least_obstacle) {
    EXPECT_EQ(Run(study, least_obstacle), 2);
    EXPECT_NE(ReadText(files_ / "e").find("results of other settings"), std::string::npos)
        << ReadText(files_ / "e");
  };
  ASSERT_EQ(Run(study), 0) << ReadText(files_ / "e");
  EXPECT_EQ(Run(study), 0) << ReadText(files_ / "e");
  expect_refused(0.6);
  EXPECT_EQ(Run(study + " --rate 10"), 2) << "another rate";
  WriteText(model,
            absl::StrReplaceAll(ReadText(source), {{"radius=\"0.065\"", "radius=\"0.075\""}}));
  expect_refused(0.5);
  WriteText(model, ReadText(source));
  EXPECT_EQ(Run(study), 0) << ReadText(files_ / "e");
  files_.WriteCell({{source, model},
                    {"capture:\n", "sound: {least_obstacle: 0.5, whole_model: true}\ncapture:\n"}});
  expect_refused(0.5);
}

TEST_F(PeopleProgram, CornersOfTheLimitsAreNotCapturedAndMisspeltMethodsAreRefusedAtOnce) {
  const auto expect_refused = [&](const std::string& options, const std::string& message) {
    EXPECT_EQ(Run(options), 2) << options;
    EXPECT_NE(ReadText(files_ / "e").find(message), std::string::npos) << ReadText(files_ / "e");
    EXPECT_FALSE(std::filesystem::exists(files_.database())) << options;
  };
  expect_refused("--methods silhoutte", "silhoutte");
  files_.WriteCell({{"  joints:\n", "  images: drawn\n  joints:\n"},
                    {"grid:\n  steps: {joint_1: 9, joint_3: 5}\n", ""}});
  expect_refused("", "give --images drawn");
}

TEST_F(PeopleProgram, SaysWhatAVideoNeeds) {
  const std::string one = "--episodes 1 --methods uncalibrated --video ";
  for (const auto& [arguments, mend] :
       {std::pair<std::string, std::string>{one + "x.avi", "--masks rendered"},
        {"--masks rendered --video x.avi", "--episodes 1"},
        {"--masks rendered " + one + "x.gif", ".mp4 or .avi"},
        {"--masks rendered " + one + "x.avi --out o", "leave --out out"}}) {
    EXPECT_EQ(Run(arguments), 2) << arguments;
    EXPECT_NE(ReadText(files_ / "e").find(mend), std::string::npos) << ReadText(files_ / "e");
  }
}

}  // namespace
}  // namespace silhouette
