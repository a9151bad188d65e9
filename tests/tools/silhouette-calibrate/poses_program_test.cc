// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate poses as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_session_file.h"
#include "calib/files/camera_file.h"
#include "calib/poses/pose_files.h"
#include "calib/robot/robot_model.h"
#include "tests/calib/poses/pose_rig.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string kUrdf = SourceFolder() + "/capture/sim/robots/rx130.urdf";
constexpr char kFiles[] = "poses --corners corners.csv --boards boards.yaml --cameras lenses ";

class CalibratePosesProgram : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) const {
    WriteFile(folder_ / name, text);
  }

  // Everything but the robot.
  void WriteRig(const PoseRig& rig) const {
    Write("corners.csv", SightingFileText(rig.problem.sightings));
    std::vector<Board> boards;
    for (const PoseBoard& board : rig.problem.boards) boards.push_back(board.board);
    Write("boards.yaml", BoardFileText(boards));
    for (const PoseView& view : rig.problem.views) {
      Write("lenses/" + CameraFileName(view.name),
            CameraFileText(CameraModel(view.lens), view.name));
    }
  }

  Ended Run(const std::string& arguments) const {
    return shell_.Run(ProgramFolder() + "/silhouette-calibrate " + arguments);
  }

  CameraModel Camera(const std::string& file) const {
    return *CameraFromText(ContentOf(folder_ / file), file);
  }

  const Shell shell_;
  const fs::path folder_ = shell_.folder();
};

TEST_F(CalibratePosesProgram, ALensForImagesOfAnotherSizeIsRefused) {
  PoseRig rig(3);
  rig.AddFlangeBoard();
  rig.Drive(8);
  const CameraIntrinsics& lens = rig.problem.views[0].lens;
  for (TagSighting& seen : rig.problem.sightings) seen.image = {lens.width / 2, lens.height / 2};
  WriteRig(rig);
  Write("poses.csv", RobotPoseFileText(rig.problem.robot_poses));
  const Ended ended =
      Run(absl::StrCat(kFiles, "--robot-poses poses.csv --flange-board flange --out cameras"));
  EXPECT_EQ(ended.exit_code, 2);
  EXPECT_THAT(ended.err, HasSubstr("view 'camera0': the image size of its camera model is "));
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
}

TEST_F(CalibratePosesProgram, WritesCamerasInTheBaseFromPosesOfTheRobot) {
  PoseRig rig(3);
  rig.AddFlangeBoard();
  rig.Drive(20);
  WriteRig(rig);
  Write("poses.csv", RobotPoseFileText(rig.problem.robot_poses));
  const Ended outcome = Run(absl::StrCat(
      kFiles,
      "--robot-poses poses.csv --flange-board flange --out cameras --draw --format json "
      "--mask-size 64x48"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json result = Json::parse(outcome.out);
  EXPECT_NEAR(result["chi2_per_dof"].get<double>(), 1, 0.25);
  const Ended doubted = Run(absl::StrCat(
      kFiles,
      "--robot-poses poses.csv --flange-board flange --out other --format json --sigma 0.5"));
  ASSERT_EQ(doubted.exit_code, 0) << doubted.err;
  EXPECT_LT(Json::parse(doubted.out)["image_noise_factor"].get<double>(), 0.2);
  EXPECT_NEAR(Json::parse(doubted.out)["chi2_per_dof"].get<double>(), 1, 0.25);
  ASSERT_EQ(result["views"].size(), 4u);
  EXPECT_LT(result["views"][0]["workspace_sigma_mm"], 0.7);
  EXPECT_EQ(result["boards"][0]["name"], "flange");
  EXPECT_EQ(result["frames"].size(), 20u);
  for (size_t i = 0; i < rig.camera_poses.size(); ++i) {
    const CameraModel camera = Camera(absl::StrCat("cameras/camera", i, ".cameramodel"));
    const auto error = PoseError(camera.camera_from_world(), rig.camera_poses[i]);
    EXPECT_LT(error.tail<3>().norm(), 2e-3);
    EXPECT_LT(error.head<3>().norm(), 1e-3);
    EXPECT_EQ(camera.intrinsics().distortion, rig.problem.views[i].lens.distortion);
  }
  EXPECT_TRUE(fs::exists(folder_ / "cameras/poses.json"));
  EXPECT_THAT(ContentOf(folder_ / "cameras/residuals.csv"), HasSubstr("frame,view,family"));
  EXPECT_FALSE(cv::imread((folder_ / "cameras/residuals_camera0.png").string()).empty());

  // All of it for the database, in calibration.yaml.
  storage::v1::CellDescription cell;
  for (const PoseView& view : rig.problem.views) cell.add_views()->set_name(view.name);
  const auto session = SessionFromText(ContentOf(folder_ / "cameras/calibration.yaml"), "", cell);
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_EQ(session->camera_files[2], "camera2.cameramodel");
  const storage::v1::CalibrationRecord& record = session->calibration.record();
  EXPECT_EQ(
      record.program(),
      "silhouette-calibrate poses: 20 frames, board 'flange' on the flange; lenses of lenses");
  const auto figure = [&](const std::string& name, const std::string& of) {
    for (const auto& each : record.figures()) {
      if (each.name() == name && each.of() == of) return each.value();
    }
    return -1.0;
  };
  EXPECT_EQ(figure("chi2_per_dof", ""), result["chi2_per_dof"]);
  EXPECT_EQ(figure("workspace_sigma", "camera1"), result["views"][1]["workspace_sigma_mm"]);
  EXPECT_NEAR(figure("epipolar_rms", "camera0 - camera2"), 0.05, 0.03);
  ASSERT_EQ(session->calibration.fundamental_matrices_size(), 6);
  for (const storage::v1::FundamentalMatrix& pair : session->calibration.fundamental_matrices()) {
    Eigen::Matrix3d f;
    for (int i = 0; i < 9; ++i) f(i / 3, i % 3) = pair.f(i);
    const auto seen = [&](int view) {
      const auto i = static_cast<size_t>(view);
      CameraIntrinsics lens = rig.problem.views[i].lens;
      lens.distortion = {};
      const CameraModel camera = CameraModel(lens, rig.camera_poses[i]).ScaledTo(64, 48);
      return camera.Project({0.2, -0.1, 0.8})->homogeneous().eval();
    };
    const Eigen::Vector3d line = f * seen(pair.view_a());
    EXPECT_LT(std::abs(line.dot(seen(pair.view_b()))) / line.head<2>().norm(), 0.01);
  }
}

// Joint values of frames all over the workspace, and what was seen with the robot near them.
std::string JointText(PoseRig& rig, double unit) {
  const RobotModel robot = *RobotModel::FromUrdf(kUrdf);
  size_t flange = 0;
  while (robot.links()[flange].name != "flange") ++flange;
  std::string text = "frame,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6\n";
  for (int i = 0; i < 40; ++i) {
    const std::vector<double> joints = {rig.Uniform(-2, 2),      rig.Uniform(-0.3, 0.6),
                                        rig.Uniform(0.8, 1.6),   rig.Uniform(-1, 1),
                                        rig.Uniform(-1.8, -0.9), rig.Uniform(-2, 2)};
    const std::string frame = absl::StrCat("f", i);
    const RobotNoise& noise = rig.problem.robot_noise;
    rig.Take(frame, robot.LinkPoses(joints)[flange] *
                        rig.SmallMotion(noise.position_sigma, noise.rotation_sigma));
    text += frame;
    for (const double joint : joints) absl::StrAppendFormat(&text, ",%.12g", joint / unit);
    text += "\n";
  }
  return text;
}

TEST_F(CalibratePosesProgram, TakesJointValuesWithTheRobotsModel) {
  PoseRig rig(4);
  rig.AddFlangeBoard();
  Write("joints.csv", JointText(rig, 1));
  WriteRig(rig);
  const std::string robot = absl::StrCat(" --urdf ", kUrdf, " --flange-board flange --out cameras");
  const Ended outcome = Run(absl::StrCat(kFiles, "--joints joints.csv", robot));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("camera0"), HasSubstr("chi2/dof"), HasSubstr("wrote")));
  for (size_t i = 0; i < rig.camera_poses.size(); ++i) {
    const CameraModel camera = Camera(absl::StrCat("cameras/camera", i, ".cameramodel"));
    EXPECT_LT(PoseError(camera.camera_from_world(), rig.camera_poses[i]).tail<3>().norm(), 2e-3);
  }
  const Ended degrees = Run(absl::StrCat(kFiles, "--joints joints.csv --degrees", robot, "2"));
  EXPECT_EQ(degrees.exit_code, 1);
  EXPECT_THAT(degrees.err, HasSubstr("in radians (without --degrees) they fit"));
  EXPECT_FALSE(fs::exists(folder_ / "cameras2"));
}

TEST_F(CalibratePosesProgram, WithoutALinkFlangeTheOneThatMostJointsMoveIsTakenAndNamed) {
  PoseRig rig(4);
  rig.AddFlangeBoard();
  Write("joints.csv", JointText(rig, 1));
  WriteRig(rig);
  // The table comes last.
  Write("robot.urdf",
        absl::StrReplaceAll(ContentOf(kUrdf), {{"\"flange\"", "\"hand\""},
                                               {"</robot>",
                                                "<link name='table'/><joint name='z' type='fixed'>"
                                                "<parent link='base'/><child link='table'/>"
                                                "</joint></robot>"}}));
  const Ended outcome = Run(absl::StrCat(
      kFiles, "--joints joints.csv --urdf robot.urdf --flange-board flange --out cameras"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out + outcome.err,
              HasSubstr("the link 'tool', which most joints move, is taken for it"));
  EXPECT_LT(
      PoseError(Camera("cameras/camera0.cameramodel").camera_from_world(), rig.camera_poses[0])
          .tail<3>()
          .norm(),
      2e-3);
}

TEST_F(CalibratePosesProgram, ALensThatIsNotKnownWhereTheRobotWorksIsRefused) {
  PoseRig rig(4, 2);
  rig.AddFlangeBoard();
  Write("joints.csv", JointText(rig, 1));
  WriteRig(rig);
  const auto write_lens = [&](const LensRegion& known) {
    Write("lenses/camera1.cameramodel",
          CameraFileText(CameraModel(rig.problem.views[1].lens), "camera1", known));
  };
  const std::string inputs =
      absl::StrCat("--joints joints.csv --urdf ", kUrdf, " --flange-board flange ");
  LensRegion right{.contour = {{640, -1}, {1281, -1}, {1281, 961}, {640, 961}, {640, -1}},
                   .sigma = 1.9};
  write_lens(right);
  const Ended refused = Run(absl::StrCat(kFiles, inputs, "--out cameras"));
  EXPECT_EQ(refused.exit_code, 1) << refused.out;
  EXPECT_THAT(refused.err, AllOf(HasSubstr("view 'camera1': the lens is not known"),
                                 HasSubstr("middle"), HasSubstr("--accept-doubts")));
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  const std::string report = absl::StrReplaceAll(kFiles, {{"poses ", "report "}});
  EXPECT_EQ(Run(absl::StrCat(report, inputs, "--groups 2 --out page.html")).exit_code, 1);
  EXPECT_THAT(ContentOf(folder_ / "page.html"), HasSubstr("camera1&#39;: the lens is not known"));

  // Accepted, the region stays with the camera.
  const Ended accepted = Run(absl::StrCat(kFiles, inputs, "--accept-doubts --out cameras"));
  EXPECT_EQ(accepted.exit_code, 0) << accepted.err;
  EXPECT_THAT(accepted.out, HasSubstr("warning: view 'camera1': the lens is not known"));
  const auto kept = LensRegionFromText(ContentOf(folder_ / "cameras/camera1.cameramodel"), "");
  ASSERT_TRUE(kept.ok() && kept->has_value());
  EXPECT_EQ((*kept)->contour, right.contour);
  EXPECT_EQ((*kept)->sigma, right.sigma);

  right.contour.pop_back();
  write_lens(right);
  const Ended open = Run(absl::StrCat(kFiles, inputs, "--out open"));
  EXPECT_EQ(open.exit_code, 2);
  EXPECT_THAT(open.err, AllOf(HasSubstr("lenses/camera1.cameramodel:"), HasSubstr("closed line")));
  EXPECT_EQ(std::ranges::count(open.err, '\n'), 1) << open.err;
}

// Row by row.
std::string NumbersOf(const Eigen::Isometry3d& pose) {
  std::string text;
  for (int i = 0; i < 16; ++i) {
    absl::StrAppendFormat(&text, "%s%.12g", i > 0 ? ", " : "", pose.matrix()(i / 4, i % 4));
  }
  return text;
}

// One camera, and a board on the flange in 12 poses.
PoseRig DrivenRig() {
  PoseRig rig(4, 1);
  rig.AddFlangeBoard();
  rig.Drive(12);
  return rig;
}

// A session of pairs, as MoveIt records it. `noise` of what is seen: metres, and radians.
std::string SamplesOf(PoseRig& rig, double noise = 1e-5) {
  std::string samples;
  for (const RobotPose& robot : rig.problem.robot_poses) {
    absl::StrAppend(&samples, "- effector_wrt_world: [", NumbersOf(robot.base_from_flange),
                    "]\n  object_wrt_sensor: [",
                    NumbersOf(rig.camera_poses[0] * robot.base_from_flange * rig.board_poses[0] *
                              rig.SmallMotion(noise, noise)),
                    "]\n");
  }
  return samples;
}

TEST_F(CalibratePosesProgram, PairsDoNotHideThatALensIsNotKnown) {
  PoseRig rig = DrivenRig();
  Write("samples.yaml", SamplesOf(rig));
  const CameraModel lens(rig.problem.views[0].lens);
  const std::string command =
      absl::StrCat("poses --cameras lenses --pairs camera0=samples.yaml ", "--cell ",
                   SourceFolder(), "/capture/sim/cells/demo/cell.yaml --out cameras");
  Write("lenses/camera0.cameramodel",
        CameraFileText(lens, "camera0", LensRegion{.contour{}, .sigma = 1.9}));
  const Ended refused = Run(command);
  EXPECT_EQ(refused.exit_code, 1) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("view 'camera0': the lens is not known"));
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  EXPECT_EQ(Run(command + " --accept-doubts").exit_code, 0);
  Write("lenses/camera0.cameramodel", CameraFileText(lens, "camera0"));
  EXPECT_EQ(Run(command).exit_code, 0);
}

TEST_F(CalibratePosesProgram, PairsHaveNoFiguresOfCornersAndTakeNoOptionsOfThem) {
  PoseRig rig = DrivenRig();
  WriteRig(rig);
  Write("samples.yaml", SamplesOf(rig));
  const std::string command = "poses --cameras lenses --pairs camera0=samples.yaml --out cameras ";
  for (const char* option : {"--boards nowhere.yaml", "--sigma 1", "--robot-sigma 1mm,1deg",
                             "--least-frames 20", "--draw"}) {
    const Ended refused = Run(command + option);
    EXPECT_EQ(refused.exit_code, 2) << option;
    EXPECT_THAT(refused.err, HasSubstr("--pairs"));
  }
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  const Ended ended = Run(command + "--format json");
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json result = Json::parse(ended.out);
  EXPECT_FALSE(result.contains("chi2_per_dof"));
  EXPECT_FALSE(result["views"][0].contains("rms_px"));
  EXPECT_TRUE(result["views"][0].contains("workspace_sigma_mm"));
  EXPECT_THAT(ContentOf(folder_ / "cameras/calibration.yaml"),
              AllOf(HasSubstr("workspace_sigma"), Not(HasSubstr("chi2_per_dof")),
                    Not(HasSubstr("corner_rms"))));
}

TEST_F(CalibratePosesProgram, PairsOfAViewTwiceAreRefusedAndTheCalibrationStays) {
  PoseRig rig = DrivenRig();
  WriteRig(rig);
  Write("samples.yaml", SamplesOf(rig));
  const std::string command = "poses --cameras lenses --out cameras --pairs camera0=samples.yaml ";
  ASSERT_EQ(Run(command).exit_code, 0);
  const std::string calibration = ContentOf(folder_ / "cameras/calibration.yaml");
  Write("more.yaml", SamplesOf(rig));
  const Ended twice = Run(command + "--pairs camera0=more.yaml");
  EXPECT_EQ(twice.exit_code, 2);
  EXPECT_THAT(twice.err, HasSubstr("--pairs has the view 'camera0' twice"));
  ASSERT_TRUE(fs::exists(folder_ / "cameras/calibration.yaml"));
  EXPECT_EQ(ContentOf(folder_ / "cameras/calibration.yaml"), calibration);
}

TEST_F(CalibratePosesProgram, PairsOfABoardWhoseSizeNothingChecksAreRefusedUnlessVouchedFor) {
  PoseRig rig(4, 1);
  rig.AddFlangeBoard();
  const Eigen::Vector3d at = rig.camera_poses[0].inverse().translation();
  for (int i = 0; i < 16; ++i) {
    Eigen::Isometry3d flange = rig.RandomFlange(at);
    flange.translation() = Eigen::Vector3d(0, 0, 0.7);
    rig.Take(absl::StrCat("f", i), flange);
  }
  WriteRig(rig);
  Write("samples.yaml", SamplesOf(rig, 1e-3));
  const std::string command = "poses --cameras lenses --pairs camera0=samples.yaml --out cameras ";
  const Ended refused = Run(command);
  EXPECT_EQ(refused.exit_code, 1) << refused.out;
  EXPECT_THAT(refused.err, AllOf(HasSubstr("view 'camera0' has boards whose size the motion"),
                                 HasSubstr("--trust-size stated"), HasSubstr("--accept-doubts")));
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  for (const char* option : {"--trust-size stated", "--accept-doubts"}) {
    const Ended taken = Run(command + option);
    EXPECT_EQ(taken.exit_code, 0) << taken.err;
    EXPECT_THAT(taken.out, HasSubstr("warning: view 'camera0' has boards whose size the motion"));
  }
}

TEST_F(CalibratePosesProgram, PairsThatGiveAViewPoorlySaySo) {
  PoseRig rig = DrivenRig();
  WriteRig(rig);
  const std::string command =
      "poses --cameras lenses --pairs camera0=samples.yaml --accept-doubts --out cameras";
  const auto poorly = HasSubstr("view 'camera0' is known poorly");
  Write("samples.yaml", SamplesOf(rig));
  EXPECT_THAT(Run(command).out, Not(poorly));
  Write("samples.yaml", SamplesOf(rig, 0.01));
  const Ended ended = Run(command);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_THAT(ended.out, poorly);
  EXPECT_THAT(ContentOf(folder_ / "cameras/calibration.yaml"), poorly);
}

// Files may grow to 4 KB: residuals.csv is longer, and the program dies as at a full disk.
TEST_F(CalibratePosesProgram, ACalibrationThatCannotBeWrittenWholeLeavesThePreviousOne) {
  PoseRig rig(3);
  rig.AddFlangeBoard();
  rig.Drive(20);
  WriteRig(rig);
  Write("poses.csv", RobotPoseFileText(rig.problem.robot_poses));
  const std::string command =
      absl::StrCat(kFiles, "--robot-poses poses.csv --flange-board flange --out cameras");
  ASSERT_EQ(Run(command).exit_code, 0);
  const auto camera = [&] { return ContentOf(folder_ / "cameras/camera0.cameramodel"); };
  const auto calibration = [&] { return ContentOf(folder_ / "cameras/calibration.yaml"); };
  const std::string previous_camera = camera();
  const std::string previous = calibration();
  rig.problem.sightings.resize(rig.problem.sightings.size() - 5);
  WriteRig(rig);
  const Ended cut_short =
      shell_.Run("ulimit -f 8; " + ProgramFolder() + "/silhouette-calibrate " + command);
  EXPECT_NE(cut_short.exit_code, 0);
  EXPECT_EQ(camera(), previous_camera);
  EXPECT_EQ(calibration(), previous);
  ASSERT_EQ(Run(command).exit_code, 0);
  EXPECT_NE(camera(), previous_camera);
  EXPECT_FALSE(fs::exists(folder_ / "cameras/.unfinished"));
}

TEST_F(CalibratePosesProgram, DegreesAreToldByTheirSize) {
  PoseRig rig(5);
  rig.AddFlangeBoard();
  Write("joints.csv", JointText(rig, kRigDegree));
  WriteRig(rig);
  const Ended outcome = Run(absl::StrCat(kFiles, "--joints joints.csv --urdf ", kUrdf,
                                         " --flange-board flange --out cameras"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("joints.csv:2"), HasSubstr("--degrees")));
}

TEST_F(CalibratePosesProgram, JointsMayStandWhereverTheirLimitsAllow) {
  PoseRig rig(5);
  rig.AddFlangeBoard();
  const std::string text = JointText(rig, 1);
  WriteRig(rig);
  // The last joint, one turn further.
  std::string turned = text.substr(0, text.find('\n') + 1);
  for (size_t line = turned.size(); line < text.size(); line = text.find('\n', line) + 1) {
    const size_t end = text.find('\n', line);
    const size_t last = text.rfind(',', end) + 1;
    absl::StrAppendFormat(&turned, "%s%.12g\n", text.substr(line, last - line),
                          std::stod(text.substr(last)) + 2 * std::numbers::pi);
  }
  Write("joints.csv", turned);
  const std::string urdf = ContentOf(kUrdf);
  const std::string command =
      absl::StrCat(kFiles, "--joints joints.csv --urdf wide.urdf --flange-board flange --out ");
  Write("wide.urdf",
        absl::StrReplaceAll(urdf, {{"\"-4.7124\" upper=\"4.7124\"", "\"-9\" upper=\"9\""}}));
  const Ended limited = Run(command + "limited");
  EXPECT_EQ(limited.exit_code, 0) << limited.err;
  // Without limits the unit tells radians from degrees.
  Write("wide.urdf", absl::StrReplaceAll(urdf, {{"\"joint_6\" type=\"revolute\"",
                                                 "\"joint_6\" type=\"continuous\""}}));
  EXPECT_THAT(Run(command + "bare").err, HasSubstr("if it is in radians write "));
  Write("joints.csv", absl::StrReplaceAll(turned, {{"joint_6\n", "joint_6\n"}, {"\n", "rad\n"}}));
  const Ended stated = Run(command + "stated");
  EXPECT_EQ(stated.exit_code, 0) << stated.err;
}

TEST_F(CalibratePosesProgram, JointValuesOfSpreadsheetsAreReadOrTheirSemicolonsAreNamed) {
  PoseRig rig(4);
  rig.AddFlangeBoard();
  const std::string text = JointText(rig, 1);
  WriteRig(rig);
  const std::string poses =
      absl::StrCat(kFiles, "--joints joints.csv --urdf ", kUrdf, " --flange-board flange --out ");
  Write("joints.csv", absl::StrCat("\xEF\xBB\xBF", absl::StrReplaceAll(text, {{"\n", "\r\n"}})));
  const Ended excel = Run(poses + "excel");
  EXPECT_EQ(excel.exit_code, 0) << excel.err;
  const size_t rows = text.find('\n');
  const std::string names = absl::StrReplaceAll(text.substr(0, rows), {{",", "\",\""}});
  Write("joints.csv", absl::StrCat("\"", names, "\"", text.substr(rows)));
  const Ended r = Run(poses + "r");
  EXPECT_EQ(r.exit_code, 0) << r.err;
  Write("joints.csv", absl::StrReplaceAll(text, {{",", ";"}, {".", ","}}));
  const Ended semicolons = Run(poses + "semicolons");
  EXPECT_EQ(semicolons.exit_code, 2);
  EXPECT_THAT(semicolons.err, HasSubstr("joints.csv:1: ';' separates the columns; save the file "
                                        "with commas, and numbers with a point"));
}

TEST_F(CalibratePosesProgram, EyeInHandAndSurveyedBoardsAreTakenTogether) {
  PoseRig rig(6, 2);
  Eigen::Isometry3d hand = Eigen::Isometry3d::Identity();
  hand.translation() = Eigen::Vector3d(0.03, -0.06, -0.05);
  rig.Add("hand", hand, true);
  Eigen::Isometry3d table = Eigen::Isometry3d::Identity();
  table.linear() = Eigen::AngleAxisd(3.14159265358979, Eigen::Vector3d::UnitX()).matrix();
  table.translation() = Eigen::Vector3d(-0.2, 0.2, 0.05);
  rig.AddBoard("table", BoardPlace::kSurveyed, table, 0.06, 3, 4);
  for (int i = 0; i < 24; ++i) {
    rig.Take(absl::StrCat("f", i), rig.RandomFlange({rig.Uniform(-0.3, 0.3), 0, 0}));
  }
  WriteRig(rig);
  Write("poses.csv", RobotPoseFileText(rig.problem.robot_poses));
  Write("survey.yaml",
        "- {board: table, position: [-0.2, 0.2, 0.05], rotation: [180 deg, 0, 0]}\n");
  const Ended outcome = Run(absl::StrCat(
      kFiles, "--robot-poses poses.csv --eye-in-hand hand --surveyed survey.yaml --out cameras"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const CameraModel camera = Camera("cameras/hand.flange.cameramodel");
  EXPECT_LT(PoseError(camera.camera_from_world(), hand).tail<3>().norm(), 1e-3);
  const CameraModel fixed = Camera("cameras/camera1.cameramodel");
  EXPECT_LT(PoseError(fixed.camera_from_world(), rig.camera_poses[1]).tail<3>().norm(), 5e-3);
  EXPECT_THAT(ContentOf(folder_ / "cameras/calibration.yaml"),
              AllOf(HasSubstr("camera1.cameramodel"), Not(HasSubstr("hand"))));
}

TEST_F(CalibratePosesProgram, ReportJudgesWhatPosesTakes) {
  PoseRig rig(8, 2);
  rig.AddFlangeBoard();
  rig.Drive(16);
  WriteRig(rig);
  Write("poses.csv", RobotPoseFileText(rig.problem.robot_poses));
  const std::string report = absl::StrReplaceAll(kFiles, {{"poses ", "report "}}) +
                             "--robot-poses poses.csv --flange-board flange --groups 3 ";
  const Ended good =
      Run(absl::StrCat(report, "--urdf ", kUrdf, " --out good.html --json good.json"));
  ASSERT_EQ(good.exit_code, 0) << good.err;
  EXPECT_THAT(good.out, AllOf(HasSubstr("camera1"), HasSubstr("wrote good.html")));
  EXPECT_THAT(ContentOf(folder_ / "good.html"), HasSubstr("<h1>Calibration report</h1>"));
  const Json result = Json::parse(ContentOf(folder_ / "good.json"));
  EXPECT_EQ(result["groups"], 3);
  EXPECT_THAT(result["workspace"].get<std::string>(), HasSubstr("by its model"));
  EXPECT_GT(result["views"][0]["predicted"]["points"], 100);
  EXPECT_EQ(Run(report + "--workspace=-1:1,0:1").exit_code, 2);
  for (TagSighting& seen : rig.problem.sightings) {
    if (seen.view == "camera1") {
      for (Eigen::Vector2d& corner : seen.corners) corner.x() = 1279 - corner.x();
    }
  }
  Write("corners.csv", SightingFileText(rig.problem.sightings));
  const Ended refused = Run(report + "--out bad.html");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("mirrored"));
  EXPECT_THAT(ContentOf(folder_ / "bad.html"), HasSubstr("No calibration: "));
}

TEST_F(CalibratePosesProgram, MistakesAreOneSentenceAndNothingIsWritten) {
  PoseRig rig(7);
  rig.AddFlangeBoard();
  rig.Drive(12);
  WriteRig(rig);
  Write("poses.csv", RobotPoseFileText(rig.problem.robot_poses));
  const auto refused = [&](const std::string& arguments, int code, const std::string& says) {
    const Ended outcome = Run(absl::StrCat(kFiles, arguments, " --out cameras"));
    EXPECT_EQ(outcome.exit_code, code) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr(says));
    EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  };
  const std::string poses = "--robot-poses poses.csv --flange-board flange ";
  refused("--robot-poses poses.csv --flange-board hand", 2, "there is no board 'hand'");
  refused(poses + "--robot-sigma 0.2", 2, "0.2mm,0.02deg");
  refused(poses + "--surveyed nowhere.yaml", 2, "nowhere.yaml");
  refused(poses + "--joints joints.csv", 2, "joints");
  refused("--robot-poses poses.csv", 1, "where the robot's base is");
  refused("--flange-board flange", 1, "give the robot's poses");
  Write("poses.csv",
        absl::StrReplaceAll(ContentOf(folder_ / "poses.csv"), {{"frame1001", "frame1000"}}));
  refused(poses, 2, "poses.csv:3: frame 'frame1000' is there already");
}

TEST_F(CalibratePosesProgram, PosesAsRobotsWriteThemGiveTheSameCameras) {
  PoseRig rig(4);
  rig.AddFlangeBoard();
  rig.Drive(14);
  WriteRig(rig);
  const std::string all = absl::StrCat(kFiles, "--flange-board flange --robot-poses ");
  Write("poses.csv", RobotPoseFileText(rig.problem.robot_poses));
  ASSERT_EQ(Run(all + "poses.csv --out quaternions").exit_code, 0);
  for (const RobotPose& pose : rig.problem.robot_poses) {
    std::string text;
    for (int i = 0; i < 16; ++i) {
      const double unit = i % 4 == 3 && i < 12 ? 1000 : 1;
      absl::StrAppendFormat(&text, "%.12g ", unit * pose.base_from_flange.matrix()(i / 4, i % 4));
    }
    Write("poses/pose_" + pose.frame + ".txt", text);
  }
  const std::string matrices = all + "'poses/pose_*.txt' --pose-notation matrix --out matrices";
  EXPECT_THAT(Run(matrices).err, HasSubstr("state them, e.g. mm (--pose-notation, --pose-units)"));
  const Ended outcome = Run(matrices + " --pose-units mm");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  for (size_t i = 0; i < rig.camera_poses.size(); ++i) {
    const std::string file = absl::StrCat("/camera", i, ".cameramodel");
    EXPECT_TRUE(Camera("matrices" + file)
                    .camera_from_world()
                    .isApprox(Camera("quaternions" + file).camera_from_world(), 1e-6));
  }
}

TEST_F(CalibratePosesProgram, PosesThatFitInAnotherNotationOrUnitAreRefusedWithItsName) {
  PoseRig rig(4);
  rig.AddFlangeBoard();
  rig.Drive(14);
  WriteRig(rig);
  std::string text;
  for (const RobotPose& pose : rig.problem.robot_poses) {
    const Eigen::AngleAxisd turn(pose.base_from_flange.linear());
    const Eigen::Vector3d vector = turn.angle() * turn.axis();
    const Eigen::Vector3d at = 1000 * pose.base_from_flange.translation();
    absl::StrAppendFormat(&text, "%s %.12g %.12g %.12g %.12g %.12g %.12g\n", pose.frame, at.x(),
                          at.y(), at.z(), vector.x(), vector.y(), vector.z());
  }
  Write("poses.txt", text);
  const std::string all = absl::StrCat(kFiles, "--flange-board flange --robot-poses poses.txt ");
  for (const char* const stated : {"--pose-notation rpy --pose-units mm,rad",
                                   "--pose-notation rotation_vector --pose-units mm,deg"}) {
    const Ended outcome = Run(absl::StrCat(all, stated, " --out cameras"));
    EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("as --pose-notation rotation_vector --pose-units mm,rad"))
        << stated;
    EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  }
}

}  // namespace
}  // namespace silhouette
