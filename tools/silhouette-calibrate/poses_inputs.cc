// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/poses_inputs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <random>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_files.h"
#include "calib/robot/robot_model.h"
#include "common/picture/files.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/files.h"

namespace silhouette {
namespace {

// A number with one of two units; false if it is not so.
bool ParseWithUnit(absl::string_view text, absl::string_view large, absl::string_view small,
                   double small_in_large, double& value) {
  text = absl::StripAsciiWhitespace(text);
  double factor = 1;
  if (absl::ConsumeSuffix(&text, small)) {
    factor = small_in_large;
  } else if (!absl::ConsumeSuffix(&text, large)) {
    return false;
  }
  if (!absl::SimpleAtod(absl::StripAsciiWhitespace(text), &value) || !(value > 0)) return false;
  value *= factor;
  return true;
}

absl::StatusOr<RobotNoise> NoiseFrom(const std::string& text) {
  RobotNoise noise;
  if (text.empty()) return noise;
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  if (parts.size() == 2 && ParseWithUnit(parts[0], "m", "mm", 1e-3, noise.position_sigma) &&
      ParseWithUnit(parts[1], "rad", "deg", std::numbers::pi / 180, noise.rotation_sigma)) {
    return noise;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--robot-sigma '", text, "' is not like 0.2mm,0.02deg"));
}

absl::Status NoSuchBoard(const std::string& board, const PoseProblem& problem,
                         const PoseSources& sources, const std::string& who) {
  std::vector<std::string> names;
  for (const PoseBoard& known : problem.boards) names.push_back(known.board.description().name);
  return absl::InvalidArgumentError(absl::StrCat(who, ": there is no board '", board, "' in '",
                                                 sources.boards, "', which has ",
                                                 ListOfWords(names)));
}

PoseBoard* BoardNamed(const std::string& name, PoseProblem& problem) {
  const auto board =
      std::find_if(problem.boards.begin(), problem.boards.end(),
                   [&](const PoseBoard& known) { return known.board.description().name == name; });
  return board == problem.boards.end() ? nullptr : &*board;
}

absl::Status PlaceSurveyed(const PoseSources& sources, PoseProblem& problem) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.survey));
  ASSIGN_OR_RETURN(const std::vector<SurveyedBoard> survey, SurveyFromText(text, sources.survey));
  for (const SurveyedBoard& surveyed : survey) {
    PoseBoard* board = BoardNamed(surveyed.board, problem);
    if (board == nullptr) return NoSuchBoard(surveyed.board, problem, sources, sources.survey);
    if (board->place == BoardPlace::kFlange) {
      return absl::InvalidArgumentError(absl::StrCat(sources.survey, ": board '", surveyed.board,
                                                     "' is on the flange and cannot be surveyed"));
    }
    board->place = BoardPlace::kSurveyed;
    board->base_from_board = surveyed.base_from_board;
    board->position_sigma = surveyed.position_sigma;
    board->rotation_sigma = surveyed.rotation_sigma;
  }
  return absl::OkStatus();
}

absl::Status PlaceBoards(const PoseSources& sources, PoseProblem& problem) {
  ASSIGN_OR_RETURN(const std::vector<Board> boards, ReadBoards(sources.boards));
  for (const Board& board : boards) {
    problem.boards.push_back(
        {.board = board,
         .place = sources.eye_in_hand.empty() ? BoardPlace::kLoose : BoardPlace::kStanding});
  }
  for (const std::string& name : sources.standing_boards) {
    PoseBoard* board = BoardNamed(name, problem);
    if (board == nullptr) return NoSuchBoard(name, problem, sources, "--standing");
    board->place = BoardPlace::kStanding;
  }
  if (!sources.flange_board.empty()) {
    PoseBoard* board = BoardNamed(sources.flange_board, problem);
    if (board == nullptr) {
      return NoSuchBoard(sources.flange_board, problem, sources, "--flange-board");
    }
    board->place = BoardPlace::kFlange;
  }
  return sources.survey.empty() ? absl::OkStatus() : PlaceSurveyed(sources, problem);
}

absl::StatusOr<std::vector<RobotPose>> PosesOfJoints(const PoseSources& sources) {
  JointFileSettings settings{
      .fixed_joints{}, .unit = sources.joint_unit, .flange_link = sources.flange_link};
  std::string urdf = sources.urdf;
  std::vector<std::string> packages;
  if (!sources.cell.empty()) {
    ASSIGN_OR_RETURN(const Cell cell, LoadCell(sources.cell));
    urdf = cell.robot.urdf;
    packages = cell.robot.package_paths;
    settings.fixed_joints = cell.fixed_joints;
  }
  if (urdf.empty()) {
    return absl::InvalidArgumentError(
        "joint values need the robot's model: give --urdf, or --cell whose robot has a urdf");
  }
  ASSIGN_OR_RETURN(const RobotModel robot, RobotModel::FromUrdf(urdf, packages));
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.joints));
  return RobotPosesOfJoints(text, sources.joints, robot, settings);
}

absl::StatusOr<std::vector<RobotPose>> ReadRobotPoses(const PoseSources& sources) {
  if (!sources.joints.empty()) return PosesOfJoints(sources);
  if (sources.robot_poses.empty()) return std::vector<RobotPose>();
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.robot_poses));
  return RobotPosesFromText(text, sources.robot_poses);
}

absl::Status ReadViews(const PoseSources& sources, PoseProblem& problem) {
  ASSIGN_OR_RETURN(const std::vector<CameraFile> cameras, ReadCameraFolder(sources.cameras));
  bool found = sources.eye_in_hand.empty();
  for (const CameraFile& named : cameras) {
    const bool on_flange = named.view == sources.eye_in_hand;
    found = found || on_flange;
    problem.views.push_back(
        {.name = named.view, .lens = named.camera.intrinsics(), .on_flange = on_flange});
  }
  if (found) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--eye-in-hand: there is no camera model of view '", sources.eye_in_hand,
                   "' in '", sources.cameras, "'"));
}

constexpr int kConfigurations = 300;

WorkspacePoints PointsOfBox(const Eigen::AlignedBox3d& box, const std::string& name) {
  constexpr int kSteps = 8;
  WorkspacePoints result{.points{}, .name = name};
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      for (int k = 0; k <= kSteps; ++k) {
        const Eigen::Vector3d share = Eigen::Vector3d(i, j, k) / kSteps;
        result.points.push_back(box.min() + share.cwiseProduct(box.sizes()));
      }
    }
  }
  return result;
}

absl::StatusOr<Eigen::AlignedBox3d> BoxFrom(const std::string& text) {
  const auto wrong = [&] {
    return absl::InvalidArgumentError(absl::StrCat(
        "--workspace '", text, "' is not like -0.5:0.5,-0.4:0.4,0:1.2 (metres, x, y and z)"));
  };
  const std::vector<std::string> ranges = absl::StrSplit(text, ',');
  if (ranges.size() != 3) return wrong();
  Eigen::AlignedBox3d box;
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<std::string> ends = absl::StrSplit(ranges[static_cast<size_t>(axis)], ':');
    if (ends.size() != 2 || !absl::SimpleAtod(ends[0], &box.min()[axis]) ||
        !absl::SimpleAtod(ends[1], &box.max()[axis]) || !(box.min()[axis] < box.max()[axis])) {
      return wrong();
    }
  }
  return box;
}

// The origins of all links in configurations by chance, the same ones each time.
WorkspacePoints PointsOfRobot(const RobotModel& robot, const Cell* cell) {
  std::vector<double> lower;
  std::vector<double> upper;
  for (const RobotJoint& joint : robot.joints()) {
    lower.push_back(joint.lower);
    upper.push_back(joint.upper);
  }
  const auto set = [&](const std::string& name, double from, double to) {
    if (const auto joint = robot.JointIndex(name)) {
      lower[*joint] = from;
      upper[*joint] = to;
    }
  };
  if (cell != nullptr) {
    for (const FixedJoint& joint : cell->fixed_joints) {
      set(joint.name, joint.position, joint.position);
    }
    for (const GridJoint& joint : cell->grid.joints()) set(joint.name, joint.lower, joint.upper);
  }
  WorkspacePoints result{
      .points{}, .name = absl::StrCat("where the links of '", robot.name(), "' get by its model")};
  std::mt19937_64 random(1);
  for (int i = 0; i < kConfigurations; ++i) {
    std::vector<double> positions;
    for (size_t joint = 0; joint < lower.size(); ++joint) {
      const double share = static_cast<double>(random() >> 11) * 0x1p-53;
      positions.push_back(lower[joint] + share * (upper[joint] - lower[joint]));
    }
    const std::vector<Eigen::Isometry3d> links = robot.LinkPoses(positions);
    for (size_t link = 1; link < links.size(); ++link) {
      result.points.emplace_back(links[link].translation());
    }
  }
  return result;
}

}  // namespace

absl::StatusOr<PoseProblem> ReadPoseProblem(const PoseSources& sources) {
  PoseProblem problem;
  ASSIGN_OR_RETURN(problem.robot_noise, NoiseFrom(sources.robot_sigma));
  RETURN_IF_ERROR(ReadViews(sources, problem));
  RETURN_IF_ERROR(PlaceBoards(sources, problem));
  ASSIGN_OR_RETURN(problem.sightings, ReadSightings(sources.corners));
  ASSIGN_OR_RETURN(problem.robot_poses, ReadRobotPoses(sources));
  return problem;
}

void AddPoseSources(CLI::App& command, PoseSources& s, bool& degrees) {
  command.add_option("--corners", s.corners, "Corners of tags (CSV)")->required();
  command.add_option("--boards", s.boards, "The boards (YAML)")->required();
  command
      .add_option("--cameras", s.cameras,
                  "Folder of camera models, VIEW.cameramodel, for their lenses")
      ->required();
  auto* poses = command.add_option("--robot-poses", s.robot_poses,
                                   "The robot's poses, base_from_flange (CSV: "
                                   "frame,tx,ty,tz,qx,qy,qz,qw; metres)");
  auto* joints = command
                     .add_option("--joints", s.joints,
                                 "Instead: its joint values (CSV: frame and the joints' names)")
                     ->excludes(poses);
  command.add_flag("--degrees", degrees, "Joint values without a unit are degrees")->needs(joints);
  command.add_option("--cell", s.cell,
                     "cell.yaml: the URDF for the pose of the flange, and the workspace");
  command.add_option("--urdf", s.urdf, "Instead: the robot's URDF")
      ->needs(joints)
      ->excludes("--cell");
  command
      .add_option("--flange-link", s.flange_link,
                  "The link that carries the board or camera; default: 'flange', else the last")
      ->needs(joints);
  command.add_option("--robot-sigma", s.robot_sigma,
                     "Standard deviation of the robot's poses, per axis; default: 0.2mm,0.02deg");
  command.add_option("--flange-board", s.flange_board, "The board on the flange");
  command.add_option("--standing", s.standing_boards,
                     "A board that stands still in all frames, at an unknown pose");
  command.add_option("--surveyed", s.survey, "Where boards stand in the base (YAML)");
  command.add_option("--eye-in-hand", s.eye_in_hand,
                     "The view on the flange; boards stand still then");
}

PoseSources WithUnit(PoseSources sources, bool degrees) {
  sources.joint_unit = degrees ? AngleUnit::kDegrees : AngleUnit::kRadians;
  return sources;
}

std::string HintOfUnit(const PoseSources& sources) {
  if (sources.joints.empty()) return "";
  const bool degrees = sources.joint_unit == AngleUnit::kDegrees;
  const absl::StatusOr<PoseProblem> problem = ReadPoseProblem(WithUnit(sources, !degrees));
  if (!problem.ok() || !CalibratePoses(*problem).ok()) return "";
  return degrees ? "with joint values in radians (without --degrees) they fit"
                 : "with joint values in degrees (--degrees) they fit";
}

absl::StatusOr<WorkspacePoints> WorkspacePointsOf(const PoseSources& sources,
                                                  const std::string& box) {
  if (!box.empty()) {
    ASSIGN_OR_RETURN(const Eigen::AlignedBox3d given, BoxFrom(box));
    return PointsOfBox(given, absl::StrCat("the box ", box, " (metres)"));
  }
  std::optional<Cell> cell;
  std::string urdf = sources.urdf;
  if (!sources.cell.empty()) {
    ASSIGN_OR_RETURN(cell, LoadCell(sources.cell));
    urdf = cell->robot.urdf;
  }
  if (urdf.empty()) {
    if (!cell || !cell->workspace) return WorkspacePoints{};
    return PointsOfBox(*cell->workspace, "the cell's workspace");
  }
  ASSIGN_OR_RETURN(
      const RobotModel robot,
      RobotModel::FromUrdf(urdf, cell ? cell->robot.package_paths : std::vector<std::string>()));
  return PointsOfRobot(robot, cell ? &*cell : nullptr);
}

}  // namespace silhouette
