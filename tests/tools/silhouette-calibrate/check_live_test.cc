// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate check, live from the cameras of a simulated cell with tags on floor and
// wall.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using testing::HasSubstr;

// `turn`: how far to the side of where it looked 'left' looks now, metres at the robot.
std::string SimulationText(double turn) {
  return absl::StrCat(R"(cameras:
  top: {image_size: [320, 240], position: [0, 0, 4.7], look_at: [0, 0, 1], up: [0, 1, 0],
        field_of_view: 58 deg, distortion: [-0.08, 0.02, 0.0005, -0.0005, 0]}
  left: {image_size: [320, 240], position: [0, 4.1, 1.3], look_at: [)",
                      turn, R"(, 0, 0.66], field_of_view: 55 deg}
room: {lower: [-4.5, -4.5, 0], upper: [4.5, 4.5, 5], brightness: 0.34, texture: 0.05}
boards:
  - {file: boards.yaml, name: floor, margin: 0.02, position: [-1.15, 1.15, 0.01],
     rotation: [180 deg, 0, 0]}
  - {file: boards.yaml, name: wall, margin: 0.02, position: [1.15, -2.5, 2.4],
     rotation: [-90 deg, 0, 180 deg]}
noise: )",
                      turn == 0 ? 1.5 : 1.6, "\n");
}

constexpr char kBoards[] = R"(- {name: floor, family: tagStandard41h12, rows: 2, columns: 2,
   tag_size: 0.5, gap: 1.3, first_id: 0}
- {name: wall, family: tagStandard41h12, rows: 2, columns: 2, tag_size: 0.5, gap: 1.3, first_id: 10}
)";

constexpr char kCell[] = R"(name: checked
simulation: simulation.yaml
robot:
  driver: sim
  urdf: $URDF
  joints:
    - {name: joint_1, lower: -10 deg, upper: 10 deg}
    - {name: joint_3, lower: 80 deg, upper: 100 deg}
  fixed: {joint_2: 40 deg, joint_4: 0, joint_5: 20 deg, joint_6: 0}
grid: {max_move: 0.35}
views:
  - {name: top, source: sim, image_size: [320, 240], mask_size: [64, 64]}
  - {name: left, source: sim, image_size: [320, 240], mask_size: [64, 64]}
capture: {settle: 0, reference_images: 4}
)";

class CheckLive : public testing::Test {
 protected:
  // A cell that was captured and calibrated.
  CheckLive() {
    Write("simulation.yaml", SimulationText(0));
    Write("boards.yaml", kBoards);
    Write("cell.yaml", absl::StrReplaceAll(
                           kCell, {{"$URDF", SourceFolder() + "/capture/sim/robots/rx130.urdf"}}));
    for (const std::string command :
         {"silhouette-capture reference --cell cell.yaml --database db",
          "silhouette-capture run --cell cell.yaml --database db",
          "silhouette-sim calibration --cell cell.yaml --out cameras",
          "silhouette-calibrate detect --cell cell.yaml --boards boards.yaml --count 2 "
          "--interval 0 --out then.csv",
          "silhouette-calibrate fundamental --cameras cameras --cell cell.yaml --calibration "
          "cameras/calibration.yaml --fixed-tags then.csv",
          "silhouette-db calibration import db cameras"}) {
      const Ended ended = Run(command);
      EXPECT_EQ(ended.exit_code, 0) << command << ": " << ended.err;
    }
  }

  void Write(const std::string& name, const std::string& text) const {
    WriteFile(shell_.folder() / name, text);
  }
  Ended Run(const std::string& command) const {
    return shell_.Run(absl::StrCat(ProgramFolder(), "/", command));
  }
  Ended Check(const std::string& options) const {
    return Run("silhouette-calibrate check --database db --cell cell.yaml --live " + options);
  }

  Shell shell_;
};

TEST_F(CheckLive, TagsAndTheParkedRobotTellWhichCameraMoved) {
  for (const std::string options : {"--sets 2 --boards boards.yaml", "--number 0"}) {
    const Ended still = Check(options);
    EXPECT_EQ(still.exit_code, 0) << options << still.out << still.err;
  }
  // 2.5 cm at 4.1 m are 1.9 px, 0.4 pixels of the mask.
  Write("simulation.yaml", SimulationText(0.025));
  for (const std::string options : {"--sets 2 --boards boards.yaml", "--number 0"}) {
    const Ended moved = Check(options + " --format json");
    EXPECT_EQ(moved.exit_code, 1) << options << moved.out << moved.err;
    const Json views = Json::parse(moved.out)["views"];
    EXPECT_TRUE(views[0]["holds"]) << options;
    EXPECT_FALSE(views[1]["holds"]) << options;
    // Behind the robot the tags have moved, too, so that its silhouette only tells that much.
    if (views[1]["checked"]) {
      EXPECT_NEAR(views[1]["shift_px"][0], 1.9, 0.4) << options;
    } else {
      EXPECT_EQ(options, "--number 0");
    }
  }
  const Ended both = Check("--number 0 --sets 1 --boards boards.yaml --out check.json");
  EXPECT_EQ(both.exit_code, 1);
  EXPECT_THAT(both.out, HasSubstr("left: MOVED"));
  EXPECT_FALSE(Json::parse(ContentOf(shell_.folder() / "check.json"))["holds"]);

  // Mistakes are told.
  const auto refused = [&](const std::string& options, const std::string& says) {
    const Ended ended = Check(options);
    EXPECT_EQ(ended.exit_code, 2) << options;
    EXPECT_THAT(ended.err, HasSubstr(says));
  };
  refused("", "--live needs --boards");
  refused("--number 99", "no configuration has the number 99");
  refused("--corners then.csv", "--corners");
}

TEST_F(CheckLive, AFrozenCameraIsNotConfirmed) {
  // Without noise the simulation repeats its images.
  Write("simulation.yaml", absl::StrReplaceAll(SimulationText(0), {{"noise: 1.5", "noise: 0"}}));
  for (const std::string options : {"--sets 1 --boards boards.yaml", "--number 0"}) {
    const Ended ended = Check(options + " --out check.json");
    EXPECT_NE(ended.exit_code, 0) << options << ended.out;
    EXPECT_THAT(ended.err, HasSubstr("is frozen: it repeats an image byte for byte")) << options;
    EXPECT_FALSE(Json::parse(ContentOf(shell_.folder() / "check.json"))["holds"]) << options;
  }
  const std::string cell = ContentOf(shell_.folder() / "cell.yaml");
  Write("cell.yaml", absl::StrReplaceAll(cell, {{"source: sim,", "source: sim, noise: none,"}}));
  const Ended stated = Check("--sets 2 --boards boards.yaml");
  EXPECT_EQ(stated.exit_code, 0) << stated.out << stated.err;
}

TEST_F(CheckLive, ACameraThatCannotBeOpenedNoLongerConfirmsTheCalibration) {
  ASSERT_EQ(Check("--sets 2 --boards boards.yaml --out check.json").exit_code, 0);
  const std::string cell = ContentOf(shell_.folder() / "cell.yaml");
  Write("cell.yaml", absl::StrReplaceAll(cell, {{"source: sim,", "source: {folder: none},"}}));
  EXPECT_NE(Check("--sets 2 --boards boards.yaml --out check.json").exit_code, 0);
  EXPECT_FALSE(Json::parse(ContentOf(shell_.folder() / "check.json"))["holds"]);
}

TEST_F(CheckLive, WithoutAnyTagInSightNoLongerConfirmsTheCalibration) {
  const auto holds = [&] {
    return Json::parse(ContentOf(shell_.folder() / "check.json"))["holds"] == true;
  };
  const Ended still = Check("--sets 2 --boards boards.yaml --out check.json");
  EXPECT_EQ(still.exit_code, 0) << still.out << still.err;
  EXPECT_TRUE(holds());
  Write("other.yaml", "- {name: other, family: tag36h11, rows: 1, columns: 1, tag_size: 0.1}\n");
  const Ended blind = Check("--sets 1 --boards other.yaml --out check.json");
  EXPECT_EQ(blind.exit_code, 1) << blind.out << blind.err;
  EXPECT_THAT(blind.err, HasSubstr("no camera of the cell sees a tag of other.yaml"));
  EXPECT_THAT(blind.err, HasSubstr("is the light on?"));
  EXPECT_THAT(blind.out, HasSubstr("top: not checked: none of the tags"));
  EXPECT_FALSE(holds());
}

}  // namespace
}  // namespace silhouette
