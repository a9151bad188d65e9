// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/poses_inputs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "calib/camera/camera_model.h"
#include "calib/intrinsics/lens_doubts.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_files.h"
#include "calib/poses/pose_frames.h"
#include "calib/robot/robot_model.h"
#include "common/picture/files.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/frame_files.h"

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
  return InvalidArgument("--robot-sigma '", text, "' is not like 0.2mm,0.02deg");
}

// InvalidArgument, beginning with `who`, if there is no such board.
absl::StatusOr<PoseBoard*> BoardNamed(const std::string& name, PoseProblem& problem,
                                      const PoseSources& sources, const std::string& who) {
  std::vector<std::string> names;
  for (PoseBoard& board : problem.boards) {
    names.push_back(board.board.description().name);
    if (names.back() == name) return &board;
  }
  return InvalidArgument(who, ": there is no board '", name, "' in '", sources.boards,
                         "', which has ", ListOfWords(names));
}

absl::Status PlaceSurveyed(const PoseSources& sources, PoseProblem& problem) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.survey));
  ASSIGN_OR_RETURN(const std::vector<SurveyedBoard> survey, SurveyFromText(text, sources.survey));
  for (const SurveyedBoard& surveyed : survey) {
    ASSIGN_OR_RETURN(PoseBoard* const board,
                     BoardNamed(surveyed.board, problem, sources, sources.survey));
    if (board->place == BoardPlace::kFlange) {
      return InvalidArgument(sources.survey, ": board '", surveyed.board,
                             "' is on the flange and cannot be surveyed");
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
    ASSIGN_OR_RETURN(PoseBoard* const board, BoardNamed(name, problem, sources, "--standing"));
    board->place = BoardPlace::kStanding;
  }
  if (!sources.flange_board.empty()) {
    ASSIGN_OR_RETURN(PoseBoard* const board,
                     BoardNamed(sources.flange_board, problem, sources, "--flange-board"));
    board->place = BoardPlace::kFlange;
  }
  return sources.survey.empty() ? absl::OkStatus() : PlaceSurveyed(sources, problem);
}

// The cell and the robot's model, as far as the sources name them.
struct CellAndRobot {
  std::optional<Cell> cell;
  std::optional<RobotModel> robot;
};

absl::StatusOr<CellAndRobot> LoadRobot(const PoseSources& sources) {
  CellAndRobot loaded;
  if (!sources.cell.empty()) {
    ASSIGN_OR_RETURN(loaded.cell, LoadCell(sources.cell));
    if (loaded.cell->robot.model != nullptr) loaded.robot = *loaded.cell->robot.model;
  } else if (!sources.urdf.empty()) {
    ASSIGN_OR_RETURN(loaded.robot, RobotModel::FromUrdf(sources.urdf));
  }
  return loaded;
}

// Adds to `warnings` what it guesses.
absl::StatusOr<std::vector<RobotPose>> PosesOfJoints(const PoseSources& sources,
                                                     std::vector<std::string>& warnings) {
  ASSIGN_OR_RETURN(const CellAndRobot loaded, LoadRobot(sources));
  if (!loaded.robot) {
    return InvalidArgument(
        "joint values need the robot's model: give --urdf, or --cell whose robot has a urdf");
  }
  JointFileSettings settings{
      .fixed_joints{}, .unit = sources.joint_unit, .flange_link = sources.flange_link};
  if (loaded.cell) settings.fixed_joints = loaded.cell->fixed_joints;
  const std::string guess = GuessedFlangeLink(*loaded.robot, sources.flange_link);
  if (!guess.empty()) warnings.push_back(guess);
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.joints));
  return RobotPosesOfJoints(text, sources.joints, *loaded.robot, settings);
}

absl::StatusOr<PoseNotation> NotationOf(const PoseSources& sources) {
  auto notation = PoseNotation::Named(sources.pose_notation, sources.pose_units);
  if (notation.ok()) return notation;
  return InvalidArgument(notation.status().message(), " (--pose-notation, --pose-units)");
}

// Adds to `warnings` what it guesses.
absl::StatusOr<std::vector<RobotPose>> ReadRobotPoses(const PoseSources& sources,
                                                      std::vector<std::string>& warnings) {
  if (!sources.joints.empty()) return PosesOfJoints(sources, warnings);
  if (sources.robot_poses.empty()) return std::vector<RobotPose>();
  ASSIGN_OR_RETURN(const PoseNotation notation, NotationOf(sources));
  if (std::filesystem::is_regular_file(sources.robot_poses)) {
    ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(sources.robot_poses));
    return RobotPosesFromText(text, sources.robot_poses, notation);
  }
  std::vector<PoseText> texts;
  for (const auto& [frame, path] : FilesOfFrames(sources.robot_poses)) {
    ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(path));
    texts.push_back({frame, path, text});
  }
  if (!texts.empty()) return RobotPosesFromTexts(texts, notation);
  return absl::NotFoundError(
      absl::StrCat("--robot-poses: there is no file '", sources.robot_poses, "'"));
}

// Reads them, and names them as the problem's frames.
absl::Status TakeRobotPoses(const PoseSources& sources, PoseProblem& problem) {
  ASSIGN_OR_RETURN(problem.robot_poses, ReadRobotPoses(sources, problem.warnings));
  ASSIGN_OR_RETURN(const std::string guessed,
                   NamePosesByFrames(problem.sightings, problem.robot_poses));
  if (!guessed.empty()) problem.warnings.push_back(guessed);
  return absl::OkStatus();
}

constexpr int kConfigurations = 300;

constexpr int kBoxSteps = 8;  // of points in a box

absl::StatusOr<Eigen::AlignedBox3d> BoxFrom(const std::string& text) {
  const auto wrong = [&] {
    return InvalidArgument("--workspace '", text,
                           "' is not like -0.5:0.5,-0.4:0.4,0:1.2 (metres, x, y and z)");
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
WorkspacePoints PointsOfRobot(const RobotModel& robot, const std::optional<Cell>& cell) {
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
  if (cell) {
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

absl::Status ReadViews(const PoseSources& sources, PoseProblem& problem) {
  ASSIGN_OR_RETURN(const std::vector<CameraFile> cameras, ReadCameraFolder(sources.cameras));
  bool found = sources.eye_in_hand.empty();
  for (const CameraFile& named : cameras) {
    const bool on_flange = named.view == sources.eye_in_hand;
    found = found || on_flange;
    problem.views.push_back({.name = named.view,
                             .lens = named.camera.intrinsics(),
                             .on_flange = on_flange,
                             .known = named.known});
  }
  if (found) return absl::OkStatus();
  return InvalidArgument("--eye-in-hand: there is no camera model of view '", sources.eye_in_hand,
                         "' in '", sources.cameras, "'");
}

absl::StatusOr<PoseProblem> ReadPoseProblem(const PoseSources& sources) {
  PoseProblem problem;
  ASSIGN_OR_RETURN(problem.robot_noise, NoiseFrom(sources.robot_sigma));
  problem.least_frames = sources.least_frames;
  problem.size_trust = sources.size_trust;
  problem.accept_doubts = sources.accept_doubts;
  RETURN_IF_ERROR(ReadViews(sources, problem));
  RETURN_IF_ERROR(PlaceBoards(sources, problem));
  ASSIGN_OR_RETURN(problem.sightings, ReadSightings(sources.corners, sources.sigma));
  std::vector<Board> boards;
  for (const PoseBoard& board : problem.boards) boards.push_back(board.board);
  RETURN_IF_ERROR(CheckFirstIds(boards, problem.sightings));
  RETURN_IF_ERROR(TakeRobotPoses(sources, problem));
  ASSIGN_OR_RETURN(WorkspacePoints workspace, WorkspacePointsOf(sources, ""));
  problem.workspace = std::move(workspace.points);
  return problem;
}

void AddPoseSources(CLI::App& command, PoseSources& s) {
  command.add_option("--corners", s.corners, "Corners of tags (CSV)")->required();
  AddSigmaOption(command, s.sigma);
  command.add_option("--boards", s.boards, "The boards (YAML)")->required();
  command
      .add_option("--cameras", s.cameras,
                  "Folder of camera models, VIEW.cameramodel, for their lenses")
      ->required();
  auto* poses = command.add_option("--robot-poses", s.robot_poses,
                                   "The robot's poses, base_from_flange: a table, JSON, or "
                                   "a file for each frame ('poses/*.txt')");
  command
      .add_option("--pose-notation", s.pose_notation,
                  "How numbers state a pose: a convention, or a robot's maker")
      ->check(CLI::IsMember(PoseNotation::Names()))
      ->capture_default_str()
      ->needs(poses);
  command
      .add_option("--pose-units", s.pose_units,
                  "Units of the poses, e.g. m,rad or mm,deg; default: the notation's")
      ->needs(poses);
  auto* joints = command
                     .add_option("--joints", s.joints,
                                 "Instead: its joint values (CSV: frame and the joints' names)")
                     ->excludes(poses);
  command
      .add_flag_callback(
          "--degrees", [&s] { s.joint_unit = AngleUnit::kDegrees; },
          "Joint values without a unit are degrees")
      ->needs(joints);
  command.add_option("--cell", s.cell,
                     "cell.yaml: the URDF for the pose of the flange, and the workspace");
  command.add_option("--urdf", s.urdf, "Instead: the robot's URDF")
      ->needs(joints)
      ->excludes("--cell");
  command
      .add_option("--flange-link", s.flange_link,
                  "The link that carries the board or camera; default: 'flange', else the one that "
                  "most joints move")
      ->needs(joints);
  command.add_option("--robot-sigma", s.robot_sigma,
                     "Standard deviation of the robot's poses, per axis; default: 0.2mm,0.02deg");
  command
      .add_option("--least-frames", s.least_frames,
                  "Refuse cameras that fewer poses of the robot hold, where no survey does")
      ->check(CLI::Range(3, 100000))
      ->capture_default_str();
  command
      .add_option(
          "--trust-size", s.size_trust,
          "What counts if a board's size contradicts the robot's motion: stated (the board's "
          "description) or found; default: found up to 1 %, more is refused")
      ->transform(CLI::CheckedTransformer(std::map<std::string, SizeTrust>{
          {"stated", SizeTrust::kStated}, {"found", SizeTrust::kFound}}))
      ->option_text("stated|found");
  command.add_flag(
      "--accept-doubts", s.accept_doubts,
      "Only warn of lenses that do not fit or are not known where the robot works, of cameras and "
      "boards that moved, and of boards whose size nothing checks");
  command.add_option("--flange-board", s.flange_board, "The board on the flange");
  command.add_option("--standing", s.standing_boards,
                     "A board that stands still in all frames, at an unknown pose");
  command.add_option("--surveyed", s.survey, "Where boards stand in the base (YAML)");
  command.add_option("--eye-in-hand", s.eye_in_hand,
                     "The view on the flange; boards stand still then");
}

namespace {

// Frames of a trial, at most: enough to see whether a notation fits.
constexpr size_t kFramesOfHint = 15;

bool Fits(PoseProblem problem) {
  std::set<std::string> frames;
  for (const TagSighting& seen : problem.sightings) frames.insert(seen.frame);
  const size_t step = (frames.size() + kFramesOfHint - 1) / kFramesOfHint;
  size_t at = 0;
  std::erase_if(frames, [&](const std::string&) { return at++ % step != 0; });
  std::erase_if(problem.sightings,
                [&](const TagSighting& seen) { return !frames.contains(seen.frame); });
  return CalibratePoses(problem).ok();
}

// How else the numbers of the robot's poses may be meant; empty if that does not fit either.
std::string HintOfNotation(const PoseSources& sources, PoseProblem problem) {
  if (problem.robot_poses.empty()) return "";
  // The last poses; many notations say the same.
  std::vector<Eigen::Isometry3d> tried = {problem.robot_poses.back().base_from_flange};
  for (const std::string& name : PoseNotation::Names()) {
    for (const char* const units : {"m,rad", "mm,deg", "m,deg", "mm,rad", "m", "mm"}) {
      if (!PoseNotation::Named(name, units).ok()) continue;
      PoseSources other = sources;
      other.pose_notation = name;
      other.pose_units = units;
      if (!TakeRobotPoses(other, problem).ok() || problem.robot_poses.empty()) continue;
      const Eigen::Isometry3d& last = problem.robot_poses.back().base_from_flange;
      const bool known = std::ranges::any_of(
          tried, [&](const Eigen::Isometry3d& one) { return one.isApprox(last, 1e-9); });
      if (known) continue;
      tried.push_back(last);
      if (!Fits(problem)) continue;
      return absl::StrCat("as --pose-notation ", name, " --pose-units ", units,
                          " the robot's poses fit");
    }
  }
  return "";
}

}  // namespace

std::string HintOfUnit(const PoseSources& sources, PoseProblem problem,
                       const std::string& refusal) {
  if (!sources.robot_poses.empty()) {
    const bool explained = absl::StrContains(refusal, "it looks as if") ||
                           absl::StrContains(refusal, "--accept-doubts");
    return explained ? "" : HintOfNotation(sources, problem);
  }
  if (sources.joints.empty()) return "";
  const bool degrees = sources.joint_unit == AngleUnit::kDegrees;
  PoseSources other = sources;
  other.joint_unit = degrees ? AngleUnit::kRadians : AngleUnit::kDegrees;
  if (!TakeRobotPoses(other, problem).ok() || !CalibratePoses(problem).ok()) return "";
  return degrees ? "with joint values in radians (without --degrees) they fit"
                 : "with joint values in degrees (--degrees) they fit";
}

absl::StatusOr<WorkspacePoints> WorkspacePointsOf(const PoseSources& sources,
                                                  const std::string& box) {
  if (!box.empty()) {
    ASSIGN_OR_RETURN(const Eigen::AlignedBox3d given, BoxFrom(box));
    return WorkspacePoints{PointsOf(given, kBoxSteps), absl::StrCat("the box ", box, " (metres)")};
  }
  ASSIGN_OR_RETURN(const auto loaded, LoadRobot(sources));
  if (loaded.robot) return PointsOfRobot(*loaded.robot, loaded.cell);
  if (!loaded.cell || !loaded.cell->workspace) return WorkspacePoints{};
  return WorkspacePoints{PointsOf(*loaded.cell->workspace, kBoxSteps), "the cell's workspace"};
}

}  // namespace silhouette
