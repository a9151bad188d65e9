// silhouette-calibrate run on the simulated cell of the demo.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "calib/calibration_camera_file.h"
#include "calib/calibration_message.h"
#include "capture/sim/simulation.h"
#include "tests/calib/urdf_files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string ReadAll(const fs::path& path) {
  std::ifstream in(path);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

const std::string kDemo = std::string(SILHOUETTE_SOURCE_DIR) + "/capture/sim/cells/demo";

class CalibrateRun : public testing::Test {
 protected:
  int Run(const std::string& program, const std::string& arguments) {
    const std::string command = std::string(SILHOUETTE_BIN_DIR) + "/" + program + " " + arguments +
                                " >" + (folder_ / "out").string() + " 2>" +
                                (folder_ / "err").string() + " </dev/null";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  int RunSession(const std::string& options) {
    return Run("silhouette-calibrate", "run --cell " + kDemo + "/cell.yaml --boards " + kDemo +
                                           "/boards.yaml --out " + session() + " " + options);
  }
  std::string Lenses() {
    const std::string folder = (folder_ / "truth").string();
    EXPECT_EQ(Run("silhouette-sim", "calibration --cell " + kDemo + "/cell.yaml --out " + folder),
              0);
    return folder;
  }
  std::string session() const { return (folder_ / "session").string(); }
  std::string err() const { return ReadAll(folder_ / "err"); }

  const fs::path folder_ = FreshFolder();
};

TEST_F(CalibrateRun, FindsTheCamerasOfTheSimulatedCell) {
  ASSERT_EQ(RunSession("--frames 16 --cameras " + Lenses()), 0) << err();
  const auto settings = LoadSimulation(kDemo + "/simulation.yaml");
  ASSERT_TRUE(settings.ok());
  for (const SimulatedCamera& truth : settings->cameras) {
    const fs::path file = fs::path(session()) / "cameras" / (truth.name + ".cameramodel");
    const auto message = CameraFromText(ReadAll(file), file.string());
    ASSERT_TRUE(message.ok()) << message.status();
    const CameraModel found = CameraFrom(*message).value();
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.8, 0, 0.8), {-0.4, 0.6, 1.2}}) {
      EXPECT_LT((*found.Project(point) - *truth.model.Project(point)).norm(), 0.5) << truth.name;
    }
  }
  const std::string calibration = ReadAll(fs::path(session()) / "cameras/calibration.yaml");
  EXPECT_THAT(calibration, HasSubstr("silhouette-calibrate run: 16 frames, board 'flange'"));
  EXPECT_THAT(calibration, HasSubstr("view_a: "));
  EXPECT_THAT(ReadAll(fs::path(session()) / "report.html"), HasSubstr("Held-out corners"));
  // What was recorded is enough to solve without a cell; a second session does not overwrite it.
  EXPECT_TRUE(fs::exists(fs::path(session()) / "images/top/0001.png"));
  EXPECT_EQ(RunSession("--frames 16"), 2);
  EXPECT_THAT(err(), HasSubstr("--resume"));
}

TEST_F(CalibrateRun, GoesOnWithWhatThereIs) {
  const std::string cameras = " --cameras " + Lenses();
  RunSession("--frames 3" + cameras);
  const std::string before = ReadAll(fs::path(session()) / "joints.csv");
  ASSERT_FALSE(before.empty());
  RunSession("--frames 5 --resume" + cameras);
  const std::string after = ReadAll(fs::path(session()) / "joints.csv");
  EXPECT_EQ(after.substr(0, before.size()), before);
  EXPECT_THAT(after, HasSubstr("\n0005,"));
}

TEST_F(CalibrateRun, MistakesAreTold) {
  EXPECT_EQ(RunSession("--flange-board door"), 2);
  EXPECT_THAT(err(), HasSubstr("'flange' and 'hand'"));
  EXPECT_EQ(RunSession("--joint elbow=0:1"), 2);
  EXPECT_THAT(err(), HasSubstr("no joint 'elbow'"));
  EXPECT_EQ(RunSession("--floor 3"), 2);
  EXPECT_THAT(err(), HasSubstr("no pose that the robot may be driven to"));
  WriteFile(folder_ / "poses.csv",
            "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6\n9,0,0,0,0,0\n");
  EXPECT_EQ(RunSession("--poses " + (folder_ / "poses.csv").string()), 2);
  EXPECT_THAT(err(), HasSubstr("poses.csv:2"));
}

}  // namespace
}  // namespace silhouette
