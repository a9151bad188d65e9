// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "capture/sim/body_part.h"
#include "capture/sim/simulation.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/capture/sim/small_cell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

absl::StatusOr<SimulationSettings> SimulationFileLoad(const std::string& text) {
  return LoadSimulation(WriteFile(FreshFolder() / "simulation.yaml", text));
}

std::string SimulationFileErrorOf(const std::string& text) {
  const auto settings = SimulationFileLoad(text);
  return settings.ok() ? "no error" : std::string(settings.status().message());
}

std::string OneCamera(const std::string& keys) {
  return "cameras:\n  cam:\n    image_size: [320, 240]\n    position: [3, 0, 1]\n" + keys;
}

TEST(SimulationFile, CameraLooksWhereItIsTold) {
  const auto settings =
      SimulationFileLoad(OneCamera("    look_at: [0, 0, 0.5]\n    field_of_view: 60 deg\n"));
  ASSERT_TRUE(settings.ok()) << settings.status();
  ASSERT_EQ(settings->cameras.size(), 1u);
  const CameraModel& camera = settings->cameras[0].model;
  EXPECT_EQ(settings->cameras[0].name, "cam");
  EXPECT_TRUE(camera.Centre().isApprox(Eigen::Vector3d(3, 0, 1)));
  const auto middle = *camera.Project({0, 0, 0.5});
  EXPECT_NEAR(middle.x(), 159.5, 1e-9);
  EXPECT_NEAR(middle.y(), 119.5, 1e-9);
  // From there +y is to the right, up is up.
  EXPECT_GT(camera.Project({0, 0.1, 0.5})->x(), 160);
  EXPECT_LT(camera.Project({0, 0, 0.6})->y(), 119);
  EXPECT_NEAR(camera.intrinsics().fx, 160 / std::tan(std::numbers::pi / 6), 1e-9);
}

TEST(SimulationFile, CameraStraightAboveSeesYUpward) {
  const auto settings = SimulationFileLoad(
      "cameras:\n  top:\n    image_size: [320, 240]\n    position: [0, 0, 4]\n"
      "    look_at: [0, 0, 0]\n    focal_length: 300\n");
  ASSERT_TRUE(settings.ok()) << settings.status();
  const CameraModel& camera = settings->cameras[0].model;
  EXPECT_LT(camera.Project({0, 1, 0})->y(), 119);
  EXPECT_GT(camera.Project({1, 0, 0})->x(), 160);
}

TEST(SimulationFile, RotationIsTheCamerasOwn) {
  // Rolled by -90 degrees about x, the camera's z looks along the world's y.
  const auto settings =
      SimulationFileLoad(OneCamera("    rotation: [-90 deg, 0, 0]\n    focal_length: 300\n"));
  ASSERT_TRUE(settings.ok()) << settings.status();
  EXPECT_TRUE(settings->cameras[0].model.Project({3, 2, 1}).has_value());
  EXPECT_FALSE(settings->cameras[0].model.Project({3, -2, 1}).has_value());
}

class SimulationFileParts : public testing::Test {
 protected:
  absl::StatusOr<SimulationSettings> LoadWith(const std::string& parts) const {
    return LoadSimulation(WriteFile(
        folder_ / "simulation.yaml",
        OneCamera("    look_at: [0, 0, 0]\n    focal_length: 300\n") + "parts:\n" + parts));
  }
  const std::filesystem::path folder_ = FreshFolder();
};

TEST_F(SimulationFileParts, AreOnTheirLinksInTheirVariantAlone) {
  const auto settings = LoadWith(
      "  box: [{link: forearm, box: {size: [0.1, 0.2, 0.3]}, position: [0, 0, 0.5],\n"
      "         colour: [0.2, 0.4, 0.6]}]\n"
      "  open: []\n");
  ASSERT_TRUE(settings.ok()) << settings.status();
  const RobotModel robot = ThreeJointRobot();
  const auto bodies = [&](const std::string& variant) {
    const auto carrying = Carrying(robot, settings->parts, variant);
    EXPECT_TRUE(carrying.ok()) << carrying.status();
    return BodyPartsOf(*carrying);
  };
  EXPECT_EQ(bodies("default").size(), BodyPartsOf(robot).size());
  EXPECT_EQ(bodies("open").size(), BodyPartsOf(robot).size());
  std::vector<BodyPart> more = bodies("box");
  ASSERT_EQ(more.size(), BodyPartsOf(robot).size() + 1);
  const auto box = std::ranges::find_if(more, [](const BodyPart& part) {
    return part.name == "forearm" && part.mesh.vertices.size() == 8 &&
           std::abs(part.mesh.vertices[0].z() - 0.5) < 0.151;
  });
  ASSERT_NE(box, more.end());
  EXPECT_TRUE((box->brightness * box->tint).isApprox(Eigen::Vector3d(0.2, 0.4, 0.6)));
}

TEST_F(SimulationFileParts, MistakesAreTold) {
  const auto error = [&](const std::string& parts, const std::string& variant) {
    const auto settings = LoadWith(parts);
    if (!settings.ok()) return std::string(settings.status().message());
    return std::string(Carrying(ThreeJointRobot(), settings->parts, variant).status().message());
  };
  const std::string sphere = "sphere: {radius: 0.1}, position: [0, 0, 0]";
  EXPECT_EQ(error("  a: [{link: forearm, " + sphere + "}]\n", "a"), "");
  EXPECT_THAT(error("  a: [{link: hand, " + sphere + "}]\n", "a"),
              HasSubstr("on the link 'hand', which the robot does not have"));
  EXPECT_THAT(error("  a: [{link: forearm, " + sphere + "}]\n", "b"),
              HasSubstr("in the variant 'b', only in 'a'; state 'b: []'"));
  EXPECT_THAT(error("  a: [{link: forearm, position: [0, 0, 0]}]\n", "a"),
              HasSubstr("a shape is missing"));
  EXPECT_THAT(error("  a: [{" + sphere + "}]\n", "a"), HasSubstr("link"));
}

class SimulationFileBoards : public testing::Test {
 protected:
  SimulationFileBoards() {
    WriteFile(folder_ / "boards.yaml",
              "- {name: wall, rows: 2, columns: 3, tag_size: 0.1, gap: 0.1}\n"
              "- {name: flange, family: tag36h11, tag_size: 0.2}\n");
  }
  absl::StatusOr<SimulationSettings> LoadWith(const std::string& boards) const {
    return LoadSimulation(WriteFile(
        folder_ / "simulation.yaml",
        OneCamera("    look_at: [0, 0, 0]\n    focal_length: 300\n") + "boards:\n" + boards));
  }
  std::string ErrorWith(const std::string& boards) const {
    const auto settings = LoadWith(boards);
    return settings.ok() ? "no error" : std::string(settings.status().message());
  }
  const std::filesystem::path folder_ = FreshFolder();
};

TEST_F(SimulationFileBoards, AreThoseOfTheBoardsFileWithTheirPlaces) {
  const auto settings = LoadWith(
      "  - {file: boards.yaml, name: wall, position: [1, 2, 3], margin: 0.02}\n"
      "  - {file: boards.yaml, name: flange, link: tool, position: [0, 0, 0.1],\n"
      "     rotation: [180 deg, 0, 0], always: false}\n");
  ASSERT_TRUE(settings.ok()) << settings.status();
  ASSERT_EQ(settings->boards.size(), 2u);
  EXPECT_EQ(settings->boards[0].board.tags(), 6);
  EXPECT_EQ(settings->boards[0].margin, 0.02);
  EXPECT_EQ(settings->boards[0].link, "");
  EXPECT_TRUE(settings->boards[0].always);
  EXPECT_TRUE(settings->boards[0].pose->translation().isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_EQ(settings->boards[1].link, "tool");
  EXPECT_FALSE(settings->boards[1].always);
  EXPECT_TRUE((*settings->boards[1].pose * Eigen::Vector3d(0.1, 0.2, 0.3))
                  .isApprox(Eigen::Vector3d(0.1, -0.2, -0.2)));
}

TEST_F(SimulationFileBoards, HeldBoardHasNoPlace) {
  const auto settings = LoadWith("  - {file: boards.yaml, name: wall, held: true}\n");
  ASSERT_TRUE(settings.ok()) << settings.status();
  EXPECT_FALSE(settings->boards[0].pose.has_value());
}

TEST_F(SimulationFileBoards, MistakesAreTold) {
  EXPECT_THAT(ErrorWith("  - {file: boards.yaml, name: door, held: true}\n"),
              AllOf(HasSubstr("simulation.yaml:8"), HasSubstr("'wall' and 'flange'")));
  EXPECT_THAT(ErrorWith("  - {file: nowhere.yaml, name: wall, held: true}\n"),
              HasSubstr("nowhere.yaml' does not exist"));
  EXPECT_THAT(ErrorWith("  - {file: boards.yaml, name: wall}\n"), HasSubstr("'position'"));
  EXPECT_THAT(ErrorWith("  - {file: boards.yaml, name: wall, held: true, link: tool}\n"),
              HasSubstr("neither 'rotation' nor 'link'"));
  EXPECT_THAT(ErrorWith("  - {file: boards.yaml, name: wall, held: true}\n"
                        "  - {file: boards.yaml, name: wall, position: [0, 0, 0]}\n"),
              HasSubstr("wall"));
  EXPECT_THAT(
      SimulationFileErrorOf(OneCamera("    look_at: [0, 0, 0]\n    focal_length: 300\nblur: 30\n")),
      HasSubstr("at most 20 pixels"));
}

TEST(SimulationFile, MistakesAreToldWithFileAndLine) {
  const std::string look = "    look_at: [0, 0, 1]\n";
  const std::string focal = "    focal_length: 300\n";
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(focal)), HasSubstr("either 'look_at' or 'rotation'"));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(look)),
              HasSubstr("'focal_length' in pixels or 'field_of_view'"));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(look + focal + "    distortion: [1, 2]\n")),
              AllOf(HasSubstr("simulation.yaml:7"), HasSubstr("4, 5 or 8 numbers")));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(look + focal + "    distortion: [-3, 0, 0, 0]\n")),
              HasSubstr("folds back"));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera("    look_at: [3, 0, 1]\n" + focal)),
              HasSubstr("own place"));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(look + "    up: [1, 0, 0]\n" + focal)),
              HasSubstr("'up' must not"));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(look + focal) + "light: {direction: [0, 0, 1]}\n"),
              HasSubstr("comes from above"));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(look + focal) + "nose: 1\n"),
              AllOf(HasSubstr("simulation.yaml:7"), HasSubstr("did you mean 'noise'")));
  EXPECT_THAT(SimulationFileErrorOf(OneCamera(look + focal) + "room: {upper: [2, 2, 2]}\n"),
              HasSubstr("'cam' stands outside the room"));
  EXPECT_THAT(SimulationFileErrorOf("cameras: {}\n"), HasSubstr("1 to 8 cameras"));
  EXPECT_THAT(SimulationFileErrorOf("cameras: [\n"), HasSubstr("simulation.yaml:"));
}

TEST(SimulationFile, EffectsOfLightAndSensorAreRead) {
  const auto settings = SimulationFileLoad(
      OneCamera("    look_at: [0, 0, 0.5]\n    field_of_view: 60 deg\n    colour: true\n") +
      "room: {colour: [0.2, 0.4, 0.4]}\nexposure: 1.5\n"
      "drift: {amplitude: 0.1, period: 1 min, slope: 0.2}\n"
      "flicker: {amplitude: 0.03, slope: 0.04}\nunsteady_pixels: {share: 0.001, jump: 30}\n");
  ASSERT_TRUE(settings.ok()) << settings.status();
  EXPECT_TRUE(settings->cameras[0].colour);
  EXPECT_NEAR(settings->room.tint.y() / settings->room.tint.x(), 2, 1e-9);
  EXPECT_EQ(settings->exposure, 1.5);
  EXPECT_EQ(settings->drift_slope, 0.2);
  EXPECT_EQ(settings->flicker_amplitude, 0.03);
  EXPECT_EQ(settings->flicker_slope, 0.04);
  EXPECT_EQ(settings->unsteady_share, 0.001);
  EXPECT_EQ(settings->unsteady_jump, 30);
  EXPECT_THAT(
      SimulationFileErrorOf(OneCamera("    look_at: [0, 0, 0.5]\n    field_of_view: 60 deg\n") +
                            "room: {colour: [0, 0, 0]}\n"),
      HasSubstr("not black"));
}

}  // namespace
}  // namespace silhouette
