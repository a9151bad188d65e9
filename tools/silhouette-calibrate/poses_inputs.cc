#include "tools/silhouette-calibrate/poses_inputs.h"

#include <algorithm>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "calib/boards/board_file.h"
#include "calib/boards/sighting_file.h"
#include "calib/poses/robot_pose_file.h"
#include "calib/poses/survey_file.h"
#include "common/picture/files.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/camera_files.h"
#include "tools/silhouette-calibrate/joint_files.h"

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
  constexpr double kDegree = 3.14159265358979323846 / 180;
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  if (parts.size() == 2 && ParseWithUnit(parts[0], "m", "mm", 1e-3, noise.position_sigma) &&
      ParseWithUnit(parts[1], "rad", "deg", kDegree, noise.rotation_sigma)) {
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
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.boards));
  ASSIGN_OR_RETURN(const std::vector<Board> boards, BoardsFromText(text, sources.boards));
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

}  // namespace

absl::StatusOr<PoseProblem> ReadPoseProblem(const PoseSources& sources) {
  PoseProblem problem;
  ASSIGN_OR_RETURN(const RobotNoise noise, NoiseFrom(sources.robot_sigma));
  problem.robot_noise = noise;
  RETURN_IF_ERROR(ReadViews(sources, problem));
  RETURN_IF_ERROR(PlaceBoards(sources, problem));
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.corners));
  ASSIGN_OR_RETURN(std::vector<TagSighting> sightings, SightingsFromText(text, sources.corners));
  problem.sightings = std::move(sightings);
  ASSIGN_OR_RETURN(std::vector<RobotPose> poses, ReadRobotPoses(sources));
  problem.robot_poses = std::move(poses);
  return problem;
}

}  // namespace silhouette
