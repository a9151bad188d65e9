// SPDX-License-Identifier: Apache-2.0
// silhouette-sim as its users meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "calib/files/camera_file.h"
#include "capture/sim/simulation.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

std::string ReadAll(const fs::path& path) {
  std::ifstream in(path);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

class SimProgram : public testing::Test {
 protected:
  Outcome Run(const std::string& arguments) const {
    const std::string command = ProgramFolder() + "/silhouette-sim " + arguments + " >" +
                                (folder_ / "out").string() + " 2>" + (folder_ / "err").string() +
                                " </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, ReadAll(folder_ / "out"),
            ReadAll(folder_ / "err")};
  }

  // A command with the cell's and the scene's file.
  Outcome RunInCell(const std::string& command, const std::string& arguments) const {
    return Run(command + " --cell " + (folder_ / "cell.yaml").string() + " --scene " +
               (folder_ / "scene.yaml").string() + " " + arguments);
  }

  void SetUp() override {
    const std::string sim = SourceFolder() + "/capture/sim/";
    WriteFile(folder_ / "cell.yaml", R"(name: test
simulation: )" + sim + R"(cells/demo/simulation.yaml
robot:
  driver: sim
  urdf: )" + sim + R"(robots/rx130.urdf
  joints: [{name: joint_1, lower: -2, upper: 2}, {name: joint_3, lower: -1, upper: 1}]
  fixed: {joint_2: 40 deg, joint_4: 0, joint_5: 20 deg, joint_6: 0}
grid: {steps: {joint_1: 9, joint_3: 5}}
views:
  - {name: top, source: sim, image_size: [320, 240]}
  - {name: left, source: sim, image_size: [320, 240]}
)");
    // In the way at joint_1 = 0, and only there.
    WriteFile(folder_ / "scene.yaml",
              "obstacles:\n  - {name: box, box: {size: [0.2, 0.2, 2]}, position: [0.9, 0, 1]}\n");
  }

  const fs::path folder_ = FreshFolder();
};

TEST_F(SimProgram, RenderWritesAnImagePerViewAndTheirList) {
  const fs::path images = folder_ / "new/images";
  const Outcome outcome =
      RunInCell("render", "--configuration 0.5,-30deg --out " + images.string());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto index = nlohmann::json::parse(ReadAll(images / "images.json"));
  EXPECT_EQ(index["joints"].size(), 6u);
  EXPECT_EQ(index["joints"]["joint_1"], 0.5);
  EXPECT_NEAR(index["joints"]["joint_3"], -0.5236, 1e-4);
  EXPECT_NEAR(index["joints"]["joint_2"], 0.6981, 1e-4);
  EXPECT_THAT(std::string(index["time"]), HasSubstr("T"));
  ASSERT_EQ(index["views"].size(), 2u);
  for (const std::string view : {"top", "left"}) {
    const std::string png = ReadAll(images / std::string(index["views"][view]));
    // Width and height stand in the PNG's header.
    EXPECT_THAT(png, HasSubstr(std::string("IHDR\0\0\x01\x40\0\0\0\xF0", 12)));
  }
}

TEST_F(SimProgram, RenderOfSeveralConfigurationsIsThatOfEachByItself) {
  const auto out = [&](const std::string& name) { return " --out " + (folder_ / name).string(); };
  ASSERT_EQ(
      RunInCell("render", "--configuration 0,0 --configuration 0.5,-30deg --frame 7" + out("both"))
          .exit_code,
      0);
  ASSERT_EQ(RunInCell("render", "--configuration 0,0 --frame 7" + out("first")).exit_code, 0);
  ASSERT_EQ(RunInCell("render", "--configuration 0.5,-30deg --frame 8" + out("second")).exit_code,
            0);
  for (const std::string view : {"top.png", "left.png"}) {
    EXPECT_EQ(ReadAll(folder_ / "both/0001" / view), ReadAll(folder_ / "first" / view));
    EXPECT_EQ(ReadAll(folder_ / "both/0002" / view), ReadAll(folder_ / "second" / view));
  }
}

TEST_F(SimProgram, RenderTakesTheRobotOutOfTheCell) {
  ASSERT_EQ(
      RunInCell("render", "--configuration 0,0 --out " + (folder_ / "with").string()).exit_code, 0);
  ASSERT_EQ(
      RunInCell("render", "--without-robot --out " + (folder_ / "without").string()).exit_code, 0);
  EXPECT_NE(ReadAll(folder_ / "with/top.png"), ReadAll(folder_ / "without/top.png"));
  EXPECT_EQ(nlohmann::json::parse(ReadAll(folder_ / "without/images.json"))["joints"].size(), 0u);
}

TEST_F(SimProgram, ContactTellsEachConfiguration) {
  const Outcome free = RunInCell("contact", "--configuration -1.5,0");
  EXPECT_EQ(free.exit_code, 0) << free.err;
  EXPECT_THAT(free.out, HasSubstr("(-1.5, 0): free, 0."));
  const Outcome both =
      RunInCell("contact", "--format json --configuration -1.5,0 --configuration 0,0.5");
  EXPECT_EQ(both.exit_code, 1);
  const auto json = nlohmann::json::parse(both.out);
  EXPECT_EQ(json["contacts"], 1);
  EXPECT_EQ(json["configurations"][0]["contact"], false);
  EXPECT_EQ(json["configurations"][1]["contact"], true);
  EXPECT_EQ(json["configurations"][1]["obstacle"], "box");
  EXPECT_EQ(json["configurations"][1]["distance"], 0);
}

TEST_F(SimProgram, LengthIsRefusedForAJointThatTurns) {
  for (const std::string command : {"contact", "render"}) {
    const Outcome outcome =
        RunInCell(command, "--configuration -1.5m,0" +
                               (command == "render" ? " --out " + (folder_ / "out").string() : ""));
    EXPECT_EQ(outcome.exit_code, 2) << command;
    EXPECT_THAT(outcome.err, HasSubstr("'-1.5m' is a length, but the joint turns"));
  }
}

TEST_F(SimProgram, ContactKnowsWhatTheRobotCarries) {
  // Beyond the arm's reach: the tool is nearest, and with the part that is.
  WriteFile(folder_ / "scene.yaml",
            "obstacles:\n  - {name: box, box: {size: [0.2, 0.2, 2]}, position: [2.5, 0, 1]}\n");
  const std::string values = "--format json --configuration 0,0.5";
  const auto bare = nlohmann::json::parse(RunInCell("contact", values).out)["configurations"][0];
  const auto part = nlohmann::json::parse(
      RunInCell("contact", values + " --variant with-part").out)["configurations"][0];
  EXPECT_EQ(bare["link"], "tool");
  EXPECT_EQ(part["link"], "tool");
  EXPECT_LT(part["distance"].get<double>(), bare["distance"].get<double>() - 0.01);
  const Outcome unknown = RunInCell("contact", values + " --variant none");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("in the variant 'none', only in 'with-part'"));
}

TEST_F(SimProgram, ContactSeesMovingObstaclesAtTheTime) {
  WriteFile(folder_ / "scene.yaml",
            "obstacles:\n  - {name: cart, box: {size: [0.2, 0.2, 2]}, position: [0.9, -5, 1], "
            "velocity: [0, 1, 0]}\n");
  EXPECT_EQ(RunInCell("contact", "--configuration 0,0.5").exit_code, 0);
  EXPECT_EQ(RunInCell("contact", "--configuration 0,0.5 --time 5").exit_code, 1);
}

TEST_F(SimProgram, TruthHasEveryConfigurationAndAgreesWithContact) {
  const fs::path truth = folder_ / "truth.csv";
  const Outcome outcome = RunInCell("truth", "--format json --out " + truth.string());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::ifstream in(truth);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "number,joint_1,joint_3,contact,distance");
  std::string in_contact;
  std::string configurations;
  int rows = 0;
  int occupied = 0;
  while (std::getline(in, line)) {
    std::vector<std::string> fields;
    std::stringstream row(line);
    for (std::string field; std::getline(row, field, ',');) fields.push_back(field);
    ASSERT_EQ(fields.size(), 5u) << line;
    configurations += " --configuration " + fields[1] + "," + fields[2];
    in_contact += fields[3];
    occupied += fields[3] == "1" ? 1 : 0;
    EXPECT_EQ(fields[3] == "1", std::stod(fields[4]) == 0) << line;
    ++rows;
  }
  EXPECT_EQ(rows, 9 * 5);
  EXPECT_GT(occupied, 0);
  EXPECT_LT(occupied, rows / 2);
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["occupied"], occupied);
  const auto json =
      nlohmann::json::parse(RunInCell("contact", "--format json" + configurations).out);
  std::string from_contact;
  for (const auto& each : json["configurations"]) from_contact += each["contact"] ? "1" : "0";
  EXPECT_EQ(in_contact, from_contact);
}

TEST_F(SimProgram, PathThroughTheObstacleIsTold) {
  const std::string path =
      WriteFile(folder_ / "path.json", R"({"waypoints": [[-1.5, 0.5], [-1, 0.5], [1, 0.5]]})");
  const Outcome outcome = RunInCell("path", "--format json --path " + path);
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["contact"], true);
  EXPECT_EQ(json["waypoint"], 1);
  EXPECT_NEAR(json["configuration"][0], -0.2, 0.15);
  EXPECT_EQ(json["configuration"][1], 0.5);
}

TEST_F(SimProgram, PathAroundTheObstacleIsFree) {
  // The arm turns away from the box and back.
  const std::string path =
      WriteFile(folder_ / "path.json", R"({"waypoints": [[-1.5, 0.5], [-1, 0.5], [-1.9, 1]]})");
  const Outcome outcome = RunInCell("path", "--path " + path);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("path of 3 waypoints"), HasSubstr("free, 0.")));
}

TEST_F(SimProgram, MistakesAreOneSentenceWithExitCodeTwo) {
  const std::string out = " --out " + (folder_ / "images").string();
  const auto expect = [&](const std::string& command, const std::string& arguments,
                          const std::string& message) {
    const Outcome outcome = RunInCell(command, arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("silhouette-sim: "), HasSubstr(message)));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_EQ(outcome.out, "") << arguments;
  };
  expect("render", out, "say where 'joint_1' stands");
  expect("render", "--configuration 0,0 --joint elbow=1" + out, "no joint 'elbow'");
  expect("render", "--configuration 0,0 --joint joint_4" + out, "is not name=value");
  expect("render", "--configuration 0,9" + out, "'joint_3' cannot stand at 9");
  expect("render", "--configuration 0,up" + out, "'up' is no joint value");
  expect("render", "--configuration 0,0 --out /proc/nowhere", "/proc/nowhere");
  expect("contact", "--configuration 0", "does not fit the grid's joints joint_1, joint_3");
  expect("truth", "--out " + (folder_ / "missing/truth.csv").string(), "cannot be written");
  expect("path", "--path " + (folder_ / "missing.json").string(), "missing.json");
  expect("path", "--path " + WriteFile(folder_ / "a.json", "{"), "not JSON");
  expect("path", "--path " + WriteFile(folder_ / "b.json", "{\"waypoints\": 1}"), "\"waypoints\"");
  expect("path", "--path " + WriteFile(folder_ / "c.json", "{\"waypoints\": [[0, 0], [0, 9]]}"),
         "waypoint 1");
  WriteFile(folder_ / "scene.yaml", "obstacles:\n  - {name: box, position: [0, 0, 0]}\n");
  expect("contact", "--configuration 0,0", "scene.yaml:2");
}

TEST_F(SimProgram, CellThatDoesNotFitTheSimulationIsNamed) {
  const std::string cell = ReadAll(folder_ / "cell.yaml");
  const auto with = [&](std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    WriteFile(folder_ / "cell.yaml", text);
    const Outcome outcome =
        RunInCell("render", "--configuration 0,0 --out " + (folder_ / "images").string());
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_THAT(with(cell, "name: top", "name: ceiling"),
              HasSubstr("no camera for the view 'ceiling'"));
  EXPECT_THAT(with(cell, "[320, 240]", "[640, 480]"), HasSubstr("takes 320 x 240"));
  EXPECT_THAT(with(cell, "rx130.urdf", "rx131.urdf"), HasSubstr("rx131.urdf' does not exist"));
}

TEST_F(SimProgram, FullDiskIsTheWorldsFault) {
  const Outcome outcome = RunInCell("truth", "--out /dev/full");
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("is the disk full?"));
}

TEST_F(SimProgram, CalibrationWritesTheTrueCameraOfEveryView) {
  const fs::path cameras = folder_ / "new/cameras";
  const std::string cell = " --cell " + (folder_ / "cell.yaml").string();
  const Outcome outcome =
      Run("calibration" + cell + " --out " + cameras.string() + " --format json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto paths = nlohmann::json::parse(outcome.out)["cameras"];
  const auto settings = LoadSimulation(SourceFolder() + "/capture/sim/cells/demo/simulation.yaml");
  ASSERT_TRUE(settings.ok()) << settings.status();
  ASSERT_EQ(paths.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    const SimulatedCamera& truth = settings->cameras[i];
    EXPECT_EQ(paths[i], (cameras / (truth.name + ".cameramodel")).string());
    const auto camera = CameraFromText(ReadAll(paths[i].get<std::string>()), "file");
    ASSERT_TRUE(camera.ok()) << camera.status();
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.3, 0.2, 1), {-0.5, 0.4, 0.2}}) {
      EXPECT_TRUE(camera->Project(point)->isApprox(*truth.model.Project(point), 1e-12));
    }
  }
}

TEST_F(SimProgram, CalibrationTellsWhereTheBoardsAre) {
  const fs::path out = folder_ / "truth";
  ASSERT_EQ(Run("calibration --cell " + (folder_ / "cell.yaml").string() + " --out " + out.string())
                .exit_code,
            0);
  EXPECT_THAT(ReadAll(out / "board_poses.yaml"),
              AllOf(HasSubstr("- name: \"flange\"\n  frame: \"flange\"\n"),
                    HasSubstr("quaternion: [1, 0, 0, ")));
}

TEST_F(SimProgram, BoardsAreShownWhenAskedFor) {
  const std::string robot = "--configuration 0.5,1.2 --out ";
  const auto render = [&](const std::string& name, const std::string& options) {
    const fs::path out = folder_ / name;
    EXPECT_EQ(RunInCell("render", robot + out.string() + options).exit_code, 0);
    return ReadAll(out / "left.png");
  };
  const std::string bare = render("bare", "");
  EXPECT_NE(render("all", " --all-boards"), bare);
  EXPECT_NE(render("held", " --hold hand=0.3,1.2,1.2,-60deg,0,200deg"), bare);
  const Outcome unknown =
      RunInCell("render", robot + (folder_ / "x").string() + " --hold door=0,0,0,0,0,0");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("no board 'door'"));
  EXPECT_EQ(RunInCell("render", robot + (folder_ / "x").string() + " --hold hand=1,2").exit_code,
            2);
}

TEST_F(SimProgram, CalibrationOfACellWithoutSimulationIsAMistake) {
  WriteFile(folder_ / "bare.yaml",
            "name: bare\nrobot: {joints: [{name: a, lower: 0, upper: 1}]}\n"
            "grid: {steps: {a: 2}}\nviews: [{name: top}]\n");
  const Outcome outcome = Run("calibration --cell " + (folder_ / "bare.yaml").string() + " --out " +
                              (folder_ / "cameras").string());
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("the key 'simulation' is missing"));
}

}  // namespace
}  // namespace silhouette
