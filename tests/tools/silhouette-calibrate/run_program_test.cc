// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate run on the simulated cell of the demo.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>

#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/camera_file.h"
#include "calib/robot/robot_model.h"
#include "capture/sim/simulation.h"
#include "tests/calib/poses/pose_rig.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

const std::string kDemo = SourceFolder() + "/capture/sim/cells/demo";
const std::string kRobot = SourceFolder() + "/capture/sim/robots/rx130.urdf";

class CalibrateRun : public testing::Test {
 protected:
  int Run(const std::string& program, const std::string& arguments) {
    const Ended ended =
        shell_.Run(ProgramFolder() + "/" + program + " " + arguments + " </dev/null");
    err_ = ended.err;
    return ended.exit_code;
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
  const std::string& err() const { return err_; }

  const Shell shell_;
  const fs::path folder_ = shell_.folder();
  std::string err_;
};

TEST_F(CalibrateRun, FindsTheCamerasOfTheSimulatedCell) {
  ASSERT_EQ(RunSession("--frames 16 --cameras " + Lenses()), 0) << err();
  const auto settings = LoadSimulation(kDemo + "/simulation.yaml");
  ASSERT_TRUE(settings.ok());
  for (const SimulatedCamera& truth : settings->cameras) {
    const fs::path file = fs::path(session()) / "cameras" / (truth.name + ".cameramodel");
    const auto found = CameraFromText(ContentOf(file), file.string());
    ASSERT_TRUE(found.ok()) << found.status();
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.8, 0, 0.8), {-0.4, 0.6, 1.2}}) {
      EXPECT_LT((*found->Project(point) - *truth.model.Project(point)).norm(), 0.5) << truth.name;
    }
  }
  const std::string calibration = ContentOf(fs::path(session()) / "cameras/calibration.yaml");
  EXPECT_THAT(calibration, HasSubstr("silhouette-calibrate run: 16 frames, board 'flange'"));
  EXPECT_THAT(calibration, HasSubstr("view_a: "));
  EXPECT_THAT(ContentOf(fs::path(session()) / "report.html"), HasSubstr("Held-out corners"));
  // What was recorded is enough to solve without a cell; a second session does not overwrite it.
  EXPECT_TRUE(fs::exists(fs::path(session()) / "images/top/0001.png"));
  EXPECT_EQ(RunSession("--frames 16"), 2);
  EXPECT_THAT(err(), HasSubstr("--resume"));
}

TEST_F(CalibrateRun, GoesOnWithWhatThereIs) {
  const std::string cameras = " --cameras " + Lenses();
  RunSession("--frames 3" + cameras);
  const std::string before = ContentOf(fs::path(session()) / "joints.csv");
  ASSERT_FALSE(before.empty());
  RunSession("--frames 5 --resume" + cameras);
  const std::string after = ContentOf(fs::path(session()) / "joints.csv");
  EXPECT_EQ(after.substr(0, before.size()), before);
  EXPECT_THAT(after, HasSubstr("\n0005,"));
}

TEST_F(CalibrateRun, AFrameThatIsDeletedIsGoneButItsImageAndNumberStay) {
  const std::string cameras = " --cameras " + Lenses();
  const fs::path folder = session();
  RunSession("--frames 3" + cameras);
  const std::string before = ContentOf(folder / "joints.csv");
  const std::string image = ContentOf(folder / "images/top/0003.png");
  ASSERT_THAT(before, HasSubstr("\n0003,"));
  ASSERT_FALSE(image.empty());
  WriteFile(folder / "joints.csv", before.substr(0, before.find("\n0003,") + 1));
  RunSession("--frames 4 --resume" + cameras);
  for (const char* file : {"joints.csv", "robot_poses.csv", "corners.csv"}) {
    EXPECT_THAT(ContentOf(folder / file), Not(HasSubstr("\n0003,"))) << file;
    EXPECT_THAT(ContentOf(folder / file), HasSubstr("\n0005,")) << file;
  }
  EXPECT_EQ(ContentOf(folder / "images/top/0003.png"), image);
  // A frame in the middle: the number of the last one is taken.
  const std::string after = ContentOf(folder / "joints.csv");
  WriteFile(folder / "joints.csv",
            after.substr(0, after.find("\n0002,")) + after.substr(after.find("\n0004,")));
  RunSession("--frames 4 --resume" + cameras);
  EXPECT_THAT(ContentOf(folder / "joints.csv"), HasSubstr("\n0006,"));
}

TEST_F(CalibrateRun, AFrameThatIsNoNumberIsNamed) {
  const std::string cameras = " --cameras " + Lenses();
  RunSession("--frames 3" + cameras);
  const fs::path joints = fs::path(session()) / "joints.csv";
  WriteFile(joints, absl::StrReplaceAll(ContentOf(joints), {{"\n0002,", "\nbad,"}}));
  EXPECT_EQ(RunSession("--frames 4 --resume" + cameras), 2);
  EXPECT_THAT(err(), HasSubstr("joints.csv:3: the frame 'bad' is not a number such as 0012"));
}

TEST_F(CalibrateRun, ResumedHasItsPosesByTheRobotsModelAndTheFlangeLinkOfNow) {
  const std::string cameras = " --cameras " + Lenses();
  const std::string resume = "--frames 3 --resume" + cameras;
  const fs::path poses = fs::path(session()) / "robot_poses.csv";
  RunSession("--frames 3" + cameras);
  const std::string whole = ContentOf(poses);
  ASSERT_THAT(whole, HasSubstr("\n0003,"));
  // As a kill between the two files leaves it.
  WriteFile(poses, whole.substr(0, whole.find("0003,")));
  RunSession(resume);
  EXPECT_EQ(ContentOf(poses), whole) << err();
  RunSession(resume + " --flange-link wrist");
  const std::string of_wrist = ContentOf(poses);
  EXPECT_THAT(of_wrist, HasSubstr("\n0003,"));
  for (const std::string& row :
       {whole.substr(whole.find("0001,"), 30), whole.substr(whole.find("0003,"), 30)}) {
    EXPECT_THAT(of_wrist, Not(HasSubstr(row)));
  }
}

// One camera near a robot that carries a larger board.
class CalibrateRunWithoutLenses : public CalibrateRun {
 protected:
  void WriteCell(const std::string& simulation) {
    WriteFile(folder_ / "boards.yaml",
              "- {name: flange, family: tagStandard41h12, rows: 3, columns: 4, tag_size: 0.09, "
              "gap: 0.09, first_id: 0}\n");
    WriteFile(folder_ / "simulation.yaml", R"(
cameras:
  left: {image_size: [480, 360], position: [0.6, 2.9, 1.3], look_at: [0.6, 0, 0.9],
         field_of_view: 44 deg, distortion: [-0.06, 0.01, 0, 0.0005, 0]}
room: {lower: [-4.5, -4.5, 0], upper: [4.5, 4.5, 5], brightness: 0.34, texture: 0.05}
boards:
  - {file: boards.yaml, name: flange, margin: 0.01, link: flange, position: [-0.3, 0.2, 0.1],
     rotation: [180 deg, 0, 0], always: false}
noise: 1.5
)" + simulation);
    WriteFile(folder_ / "cell.yaml", R"(name: near
simulation: simulation.yaml
robot:
  driver: sim
  urdf: )" + kRobot + R"(
  joints:
    - {name: joint_1, lower: -150 deg, upper: 150 deg}
    - {name: joint_3, lower: -120 deg, upper: 110 deg}
  fixed: {joint_2: 40 deg, joint_4: 0, joint_5: 20 deg, joint_6: 0}
grid: {max_move: 0.35}
views: [{name: left, source: sim, image_size: [480, 360], mask_size: [64, 64]}]
capture: {settle: 0}
)");
  }
  // The robot of WriteCell with a changed URDF.
  void ChangeRobot(const std::vector<std::pair<std::string, std::string>>& changes) {
    const fs::path urdf = folder_ / "robot.urdf";
    WriteFile(urdf, absl::StrReplaceAll(ContentOf(kRobot), changes));
    WriteFile(folder_ / "cell.yaml",
              absl::StrReplaceAll(ContentOf(folder_ / "cell.yaml"), {{kRobot, urdf.string()}}));
  }
  // The board on the robot is as WriteCell has it, but described in another way.
  void DescribeBoard(const std::string& gap_and_first_id) {
    WriteFile(folder_ / "mounted.yaml", ContentOf(folder_ / "boards.yaml"));
    WriteFile(folder_ / "simulation.yaml",
              absl::StrReplaceAll(ContentOf(folder_ / "simulation.yaml"),
                                  {{"boards.yaml", "mounted.yaml"}}));
    WriteFile(folder_ / "boards.yaml",
              "- {name: flange, family: tagStandard41h12, rows: 3, columns: 4, tag_size: 0.09, " +
                  gap_and_first_id + "}\n");
  }
  // A recorded session of an exact robot. After half of it the camera is moved by `pushed` metres.
  void WriteSession(double pushed) {
    constexpr int kFrames = 80;
    PoseRig rig(6, 1);
    rig.problem.views[0].name = "left";
    rig.corner_sigma = 0.01;
    rig.AddFlangeBoard();
    const RobotModel robot = *RobotModel::FromUrdf(kRobot);
    size_t flange = 0;
    while (robot.links()[flange].name != "flange") ++flange;
    std::string joints = "frame,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6\n";
    for (int i = 0; i < kFrames; ++i) {
      if (i == kFrames / 2) {
        rig.camera_poses[0] = Eigen::Translation3d(pushed, 0, 0) * rig.camera_poses[0];
      }
      const std::vector<double> at = {rig.Uniform(-2, 2),      rig.Uniform(-0.3, 0.6),
                                      rig.Uniform(0.8, 1.6),   rig.Uniform(-1, 1),
                                      rig.Uniform(-1.8, -0.9), rig.Uniform(-2, 2)};
      const std::string frame = absl::StrFormat("%04d", i + 1);
      rig.Take(frame, robot.LinkPoses(at)[flange] * rig.SmallMotion(0.04e-3, 7e-5));
      joints += frame;
      for (const double joint : at) absl::StrAppendFormat(&joints, ",%.12g", joint);
      joints += "\n";
    }
    const fs::path session_folder = session();
    WriteFile(session_folder / "joints.csv", joints);
    WriteFile(session_folder / "corners.csv", SightingFileText(rig.problem.sightings));
    WriteFile(folder_ / "boards.yaml", BoardFileText(std::vector{rig.problem.boards[0].board}));
    WriteFile(folder_ / "lenses/left.cameramodel",
              CameraFileText(CameraModel(rig.problem.views[0].lens), "left"));
    for (const char* file : {"cell.yaml", "simulation.yaml"}) {
      WriteFile(folder_ / file,
                absl::StrReplaceAll(ContentOf(folder_ / file), {{"[480, 360]", "[1280, 960]"}}));
    }
  }
  std::string Command(const std::string& options) {
    const std::string folder = folder_.string();
    return "run --cell " + folder + "/cell.yaml --boards " + folder + "/boards.yaml --out " +
           session() + " " + options;
  }
};

TEST_F(CalibrateRunWithoutLenses, FindsThemFromTheBoardOnTheFlange) {
  WriteCell("");
  // Too few to know a lens by: the images stay, and more can be added.
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 4")), 1);
  EXPECT_THAT(err(), HasSubstr("--resume"));
  ASSERT_EQ(Run("silhouette-calibrate", Command("--frames 14 --resume")), 0) << err();
  const fs::path file = fs::path(session()) / "cameras/left.cameramodel";
  const auto found = CameraFromText(ContentOf(file), file.string());
  ASSERT_TRUE(found.ok()) << found.status();
  const CameraModel truth =
      LoadSimulation((folder_ / "simulation.yaml").string())->cameras[0].model;
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.8, 0, 0.8), {0.2, 0.4, 1.2}}) {
    EXPECT_LT((*found->Project(point) - *truth.Project(point)).norm(), 0.5);
  }
  EXPECT_THAT(ContentOf(file), HasSubstr("valid_intrinsics_region"));
  EXPECT_THAT(ContentOf(fs::path(session()) / "cameras/calibration.yaml"),
              HasSubstr("lens_rim_sigma"));
}

TEST_F(CalibrateRunWithoutLenses, WhatIntrinsicsRefusesIsRefused) {
  WriteCell("");
  DescribeBoard("gap: 0.08, first_id: 0");
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 14")), 1) << err();
  EXPECT_THAT(err(), HasSubstr("the gaps between the tags of board 'flange' are about 1.00 of a "
                               "tag (90 mm), not 0.89 (80 mm)"));
  EXPECT_FALSE(fs::exists(fs::path(session()) / "cameras"));
}

// Boards that stand still would be of another kind, and show the lens one place of the image.
TEST_F(CalibrateRunWithoutLenses, OnlyTheBoardOnTheFlangeGivesThem) {
  WriteCell("");
  WriteSession(0);
  const fs::path corners = fs::path(session()) / "corners.csv";
  std::vector<TagSighting> sightings = *SightingsFromText(ContentOf(corners), "corners.csv");
  ASSERT_GE(sightings.size(), 3u);
  sightings.resize(3);
  for (size_t i = 0; i < 3; ++i) {
    sightings.push_back(sightings[i]);
    sightings.back().tag = 5;
  }
  WriteFile(corners, SightingFileText(sightings));
  // Too many tags for a lens.
  WriteFile(folder_ / "boards.yaml",
            ContentOf(folder_ / "boards.yaml") +
                "- {name: wall, family: tagStandard41h12, rows: 40, columns: 52, tag_size: 0.12, "
                "gap: 0.12, first_id: 1}\n");
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 80 --resume")), 1) << err();
  EXPECT_THAT(err(), HasSubstr("The images are kept: "));
  EXPECT_THAT(err(), Not(HasSubstr("board 'wall'")));
}

TEST_F(CalibrateRunWithoutLenses, ThatABoardCannotGiveAreRefusedWithTheWayToGoOn) {
  WriteCell("");
  WriteSession(0);
  WriteFile(folder_ / "boards.yaml",
            "- {name: flange, family: tagStandard41h12, rows: 40, columns: 52, tag_size: 0.12, "
            "gap: 0.12, first_id: 0}\n");
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 80 --resume")), 2) << err();
  EXPECT_THAT(err(), HasSubstr("it needs a lattice too large for the lenses"));
  EXPECT_THAT(err(), HasSubstr("The images are kept: "));
}

TEST_F(CalibrateRunWithoutLenses, ACalibrationThatItsReportFindsUnstableIsANo) {
  WriteCell("");
  const std::string solve =
      Command("--frames 80 --resume --robot-sigma 0.04mm,0.004deg --cameras " +
              (folder_ / "lenses").string());
  const fs::path calibration = fs::path(session()) / "cameras/calibration.yaml";
  WriteSession(0);
  EXPECT_EQ(Run("silhouette-calibrate", solve), 0) << err();
  EXPECT_THAT(ContentOf(calibration), Not(HasSubstr("the first half of the frames")));
  WriteSession(0.55e-3);
  EXPECT_EQ(Run("silhouette-calibrate", solve), 1) << err();
  EXPECT_THAT(err(), HasSubstr("the calibration is not stable"));
  EXPECT_THAT(ContentOf(calibration), HasSubstr("between the first half of the frames and the "));
}

TEST_F(CalibrateRunWithoutLenses, ThePrintedCommandSolvesWithoutTheRobotAndRefusesWhatRunRefuses) {
  WriteCell("");
  WriteSession(0.55e-3);
  const std::string lenses = (folder_ / "known lenses").string();
  fs::rename(folder_ / "lenses", lenses);
  EXPECT_EQ(Run("silhouette-calibrate",
                Command("--frames 81 --resume --floor 3 --robot-sigma 0.04mm,0.004deg --cameras '" +
                        lenses + "'")),
            2);
  const std::string printed = "(the robot does not move): ";
  const size_t place = err().find(printed);
  ASSERT_NE(place, std::string::npos) << err();
  const std::string command = err().substr(place + printed.size());
  EXPECT_THAT(command, HasSubstr(" --cell " + folder_.string() + "/cell.yaml "));
  EXPECT_THAT(command, HasSubstr(" --robot-sigma 0.04mm,0.004deg"));
  fs::remove(folder_ / "simulation.yaml");  // robot and cameras
  const Ended solved = shell_.Run("PATH=" + ProgramFolder() + ":$PATH; " + command);
  EXPECT_EQ(solved.exit_code, 1) << solved.err;
  EXPECT_THAT(solved.err, HasSubstr("the calibration is not stable"));
}

TEST_F(CalibrateRunWithoutLenses, ABoardThatNoCameraSeesIsToldSoon) {
  WriteCell("");
  DescribeBoard("gap: 0.09, first_id: 60");
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 20")), 2);
  EXPECT_THAT(err(), HasSubstr("the board 'flange' was seen in 0 of 20 poses only"));
}

TEST_F(CalibrateRunWithoutLenses, LinksThatNoJointMovesMayBeBelowTheFloor) {
  WriteCell("");
  ChangeRobot({{"</robot>",
                "<link name='pedestal'/><joint name='foot' type='fixed'><parent link='base'/>"
                "<child link='pedestal'/><origin xyz='0 0 -0.7'/></joint></robot>"}});
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 3")), 1) << err();
  EXPECT_THAT(ContentOf(fs::path(session()) / "joints.csv"), HasSubstr("\n0003,")) << err();
}

TEST_F(CalibrateRunWithoutLenses, WithoutALinkFlangeTheOneThatMostJointsMoveIsTakenAndNamed) {
  WriteCell("");
  ChangeRobot({{"\"flange\"", "\"hand\""},
               {"\"tool\"", "\"nozzle\""},
               {"</robot>",
                "<link name='table'/><joint name='z_table' type='fixed'><parent link='base'/>"
                "<child link='table'/></joint></robot>"}});
  WriteFile(folder_ / "simulation.yaml", absl::StrReplaceAll(ContentOf(folder_ / "simulation.yaml"),
                                                             {{"link: flange", "link: hand"}}));
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 3")), 1) << err();
  EXPECT_THAT(err(), HasSubstr("the link 'nozzle', which most joints move, is taken"));
  const std::string poses = ContentOf(fs::path(session()) / "robot_poses.csv");
  const auto pose_of = [&](const std::string& frame) {
    const size_t begin = poses.find(frame) + frame.size();
    return poses.substr(begin, poses.find('\n', begin) - begin);
  };
  EXPECT_NE(pose_of("\n0001,"), pose_of("\n0002,")) << "the link moves";
  EXPECT_EQ(Run("silhouette-calibrate", Command("--frames 3 --resume --flange-link hand")), 1);
  EXPECT_THAT(err(), Not(HasSubstr("is taken for it")));
}

TEST_F(CalibrateRunWithoutLenses, CtrlCStopsTheRobotAndSaysHowToGoOn) {
  WriteCell("joint_speed: 0.01\n");  // minutes to the first pose
  // The folder is made before the robot sets off.
  const auto start = std::chrono::steady_clock::now();
  const Ended ended = shell_.Run(ProgramFolder() + "/silhouette-calibrate " + Command("") +
                                 " & p=$!; while kill -0 $p && [ ! -d " + session() +
                                 " ]; do sleep 0.1; done; sleep 0.5; kill -INT $p; wait $p");
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(120));
  EXPECT_THAT(ended.err,
              HasSubstr("stopped, and so is the robot; 0 frames are kept. Go on with the "
                        "same command and --resume"));
}

TEST_F(CalibrateRun, FloorThatLeavesNoPoseIsNamedWithItsOption) {
  EXPECT_EQ(RunSession("--floor 0.4 --joint joint_3=100deg:110deg"), 2);
  EXPECT_THAT(err(), HasSubstr("most often the floor at 0.4 m (--floor) is in the way"));
}

TEST_F(CalibrateRun, ARobotWhoseBodyStandsBelowTheFloorIsNotMoved) {
  // The joint of the upper arm is at 0.56 m, its body reaches down to 0.435 m.
  EXPECT_EQ(RunSession("--floor 0.5"), 2);
  EXPECT_THAT(err(), HasSubstr("the robot's link 'upper_arm' or what it carries is below the floor "
                               "at 0.5 m (--floor) already; move the robot up"));
}

TEST_F(CalibrateRun, APoseWhoseWayDipsBelowTheFloorIsRefused) {
  // The arm points down, 40 degrees to one side of the vertical, then to the other.
  const std::string poses = (folder_ / "poses.csv").string();
  WriteFile(poses,
            "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6\n"
            "0,1.3963,1.0472,0,0,0\n0,1.3963,2.4435,0,0,0\n");
  EXPECT_EQ(RunSession("--floor=-0.4 --poses " + poses), 2);
  EXPECT_THAT(err(), HasSubstr("pose 2 of the list: the floor at -0.4 m (--floor) is in the way"));
}

TEST_F(CalibrateRun, OnlyASessionThatIsThereIsResumed) {
  EXPECT_EQ(RunSession("--resume"), 2);
  EXPECT_THAT(err(), HasSubstr("there is no session '" + session() + "' to go on with"));
  EXPECT_FALSE(fs::exists(session()));
}

TEST_F(CalibrateRun, MistakesAreTold) {
  EXPECT_EQ(RunSession("--flange-board door"), 2);
  EXPECT_THAT(err(), HasSubstr("'flange' and 'hand'"));
  EXPECT_EQ(RunSession("--joint elbow=0:1"), 2);
  EXPECT_THAT(err(), HasSubstr("no joint 'elbow'"));
  WriteFile(folder_ / "poses.csv",
            "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6\n9,0,0,0,0,0\n");
  EXPECT_EQ(RunSession("--poses " + (folder_ / "poses.csv").string()), 2);
  EXPECT_THAT(err(), HasSubstr("poses.csv:2"));
}

}  // namespace
}  // namespace silhouette
