// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/run_settings.h"

#include <algorithm>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "calib/boards/csv.h"
#include "common/picture/files.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"
#include "tools/program/joint_values.h"
#include "tools/silhouette-calibrate/files.h"

namespace silhouette {
namespace {

constexpr size_t kWristJoints = 3;
constexpr double kWristRange = std::numbers::pi / 3;

absl::StatusOr<std::string> FlangeBoardOf(const std::vector<Board>& boards,
                                          const std::string& name) {
  std::vector<std::string> names;
  for (const Board& board : boards) {
    names.push_back(board.description().name);
    if (names.back() == (name.empty() ? "flange" : name)) return names.back();
  }
  if (name.empty() && boards.size() == 1) return names[0];
  return absl::InvalidArgumentError(
      absl::StrCat("which board is on the flange? --flange-board is one of ", ListOfWords(names)));
}

// The joints in front of the link, from the base outward.
std::vector<size_t> JointsTo(const RobotModel& robot, size_t link) {
  std::vector<size_t> joints;
  for (int i = static_cast<int>(link); i >= 0; i = robot.links()[static_cast<size_t>(i)].parent) {
    const int joint = robot.links()[static_cast<size_t>(i)].joint;
    if (joint >= 0) joints.insert(joints.begin(), static_cast<size_t>(joint));
  }
  return joints;
}

PosePlan::Positions RestOf(const Cell& cell, const RobotModel& robot) {
  PosePlan::Positions rest;
  for (const RobotJoint& joint : robot.joints()) {
    rest.push_back(std::clamp(0.0, joint.lower, joint.upper));
  }
  for (const FixedJoint& joint : cell.fixed_joints) {
    if (const auto index = robot.JointIndex(joint.name)) rest[*index] = joint.position;
  }
  return rest;
}

std::vector<MovingJoint> UsualJoints(const Cell& cell, const RobotModel& robot,
                                     const SessionSettings& settings) {
  std::vector<MovingJoint> moving;
  for (const GridJoint& joint : cell.grid.joints()) {
    moving.push_back({robot.JointIndex(joint.name).value(), joint.lower, joint.upper});
  }
  const std::vector<size_t> chain = JointsTo(robot, settings.flange);
  for (size_t i = chain.size() - std::min(kWristJoints, chain.size()); i < chain.size(); ++i) {
    const bool in_grid = std::any_of(moving.begin(), moving.end(), [&](const MovingJoint& joint) {
      return joint.joint == chain[i];
    });
    if (in_grid) continue;
    const RobotJoint& joint = robot.joints()[chain[i]];
    moving.push_back({chain[i], std::max(joint.lower, settings.rest[chain[i]] - kWristRange),
                      std::min(joint.upper, settings.rest[chain[i]] + kWristRange)});
  }
  return moving;
}

absl::StatusOr<MovingJoint> ParseRange(const std::string& text, const RobotModel& robot) {
  const std::vector<std::string> sides = absl::StrSplit(text, absl::MaxSplits('=', 1));
  const std::vector<std::string> bounds =
      sides.size() == 2 ? std::vector<std::string>(absl::StrSplit(sides[1], ':'))
                        : std::vector<std::string>();
  if (bounds.size() != 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("--joint ", text, ": name=lower:upper is expected, e.g. wrist=-30deg:30deg"));
  }
  const auto index = robot.JointIndex(sides[0]);
  if (!index) {
    return absl::InvalidArgumentError(
        absl::StrCat("--joint ", text, ": the robot has no joint '", sides[0], "'"));
  }
  const double lower = ParseJointValue(bounds[0]);
  const double upper = ParseJointValue(bounds[1]);
  const RobotJoint& joint = robot.joints()[*index];
  if (!(lower <= upper && lower >= joint.lower && upper <= joint.upper)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--joint ", text, ": the bounds are not in order, or beyond the joint's ",
                     joint.lower, " to ", joint.upper));
  }
  return MovingJoint{*index, lower, upper};
}

absl::StatusOr<std::vector<PosePlan::Positions>> ReadPoses(const std::string& path,
                                                           const RobotModel& robot) {
  ASSIGN_OR_RETURN(const auto text, ReadWholeFile(path));
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints()) names.push_back(joint.name);
  ASSIGN_OR_RETURN(const auto rows, CsvRows(text, path, names));
  std::vector<PosePlan::Positions> poses;
  for (const CsvRow& row : rows) {
    PosePlan::Positions values;
    for (size_t j = 0; j < names.size(); ++j) {
      ASSIGN_OR_RETURN(const auto value, row.Number(j));
      values.push_back(value);
    }
    const auto positions = robot.Positions(names, values);
    if (!positions.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(row.place(), ": ", positions.status().message()));
    }
    poses.push_back(*positions);
  }
  if (poses.empty()) return absl::InvalidArgumentError(path + ": there is no pose in it");
  return poses;
}

absl::StatusOr<std::vector<CameraIntrinsics>> ReadLenses(const std::string& folder,
                                                         const Cell& cell) {
  ASSIGN_OR_RETURN(const auto cameras, ReadCameraFolder(folder));
  std::vector<CameraIntrinsics> lenses;
  for (const ViewSettings& view : cell.views) {
    const auto found = std::find_if(cameras.begin(), cameras.end(),
                                    [&](const auto& named) { return named.view == view.name; });
    if (found == cameras.end()) {
      return absl::NotFoundError(
          absl::StrCat("there is no camera model of the view '", view.name, "' in ", folder));
    }
    const CameraIntrinsics& lens = found->camera.intrinsics();
    if (lens.width != view.image_width || lens.height != view.image_height) {
      return absl::InvalidArgumentError(absl::StrCat(
          folder, ": the camera of '", view.name, "' is for images of ", lens.width, " x ",
          lens.height, ", the cell's are ", view.image_width, " x ", view.image_height));
    }
    lenses.push_back(lens);
  }
  return lenses;
}

}  // namespace

absl::StatusOr<SessionSettings> SettingsOf(const RunArguments& arguments, const Cell& cell,
                                           const RobotModel& robot) {
  SessionSettings settings;
  settings.folder = arguments.out;
  settings.frames = arguments.frames;
  settings.seed = arguments.seed;
  settings.floor = arguments.floor.value_or(cell.workspace ? cell.workspace->min().z() : 0);
  ASSIGN_OR_RETURN(settings.boards, ReadBoards(arguments.boards));
  ASSIGN_OR_RETURN(settings.flange_board, FlangeBoardOf(settings.boards, arguments.flange_board));
  ASSIGN_OR_RETURN(settings.flange, FlangeLink(robot, arguments.flange_link));
  settings.rest = RestOf(cell, robot);
  settings.joints = UsualJoints(cell, robot, settings);
  if (!arguments.joints.empty()) settings.joints.clear();
  for (const std::string& range : arguments.joints) {
    ASSIGN_OR_RETURN(const auto joint, ParseRange(range, robot));
    settings.joints.push_back(joint);
  }
  if (!arguments.poses.empty()) {
    ASSIGN_OR_RETURN(settings.given, ReadPoses(arguments.poses, robot));
  }
  if (!arguments.cameras.empty()) {
    ASSIGN_OR_RETURN(settings.lenses, ReadLenses(arguments.cameras, cell));
  }
  return settings;
}

}  // namespace silhouette
