// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_files.h"

#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/boards/csv.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

const std::vector<std::string>& Columns() {
  static const std::vector<std::string> columns = {"frame", "tx", "ty", "tz",
                                                   "qx",    "qy", "qz", "qw"};
  return columns;
}

absl::Status Mistake(const CsvRow& row, const std::string& what) {
  return InvalidArgument(row.place(), ": ", what);
}

absl::StatusOr<RobotPose> RobotPoseOf(const CsvRow& row) {
  std::array<double, 7> values{};
  for (size_t i = 0; i < values.size(); ++i) {
    ASSIGN_OR_RETURN(const double value, row.Number(i + 1));
    values[i] = value;
  }
  RobotPose pose{.frame = row.Text(0)};
  if (pose.frame.empty()) return Mistake(row, "the frame has no name");
  const Eigen::Vector3d position(values[0], values[1], values[2]);
  if (position.norm() > kFarthestFlange) {
    return Mistake(row,
                   absl::StrFormat("the flange is %.0f m from the robot's base; positions look "
                                   "like millimetres, give metres",
                                   position.norm()));
  }
  const Eigen::Quaterniond rotation(values[6], values[3], values[4], values[5]);
  if (std::abs(rotation.norm() - 1) > 0.01) {
    return Mistake(row,
                   absl::StrFormat("the quaternion's length is %.4g, not 1; give qx, qy, qz, qw "
                                   "(not angles, nor a rotation vector)",
                                   rotation.norm()));
  }
  pose.base_from_flange.linear() = rotation.normalized().matrix();
  pose.base_from_flange.translation() = position;
  return pose;
}

}  // namespace

std::string RobotPoseFileText(const std::vector<RobotPose>& poses) {
  std::string text = "frame,tx,ty,tz,qx,qy,qz,qw\n";
  for (const RobotPose& pose : poses) {
    absl::StrAppend(&text, CsvField(pose.frame));
    for (double value : pose.base_from_flange.translation()) {
      absl::StrAppend(&text, ",", CsvNumber(value));
    }
    const Eigen::Quaterniond rotation(pose.base_from_flange.linear());
    for (double value : rotation.coeffs()) absl::StrAppend(&text, ",", CsvNumber(value));
    absl::StrAppend(&text, "\n");
  }
  return text;
}

absl::StatusOr<std::vector<RobotPose>> RobotPosesFromText(const std::string& text,
                                                          const std::string& file) {
  ASSIGN_OR_RETURN(const std::vector<CsvRow> rows, CsvRows(text, file, Columns()));
  std::vector<RobotPose> poses;
  std::map<std::string, std::string> places;
  for (const CsvRow& row : rows) {
    ASSIGN_OR_RETURN(RobotPose pose, RobotPoseOf(row));
    const auto [other, added] = places.emplace(pose.frame, row.place());
    if (!added) {
      return Mistake(row, absl::StrCat("frame '", pose.frame, "' is there already, at ",
                                       other->second, "; leave one"));
    }
    poses.push_back(std::move(pose));
  }
  return poses;
}

namespace {

Eigen::Matrix3d RotationOf(const YamlNode& node) {
  const std::vector<YamlNode> angles = node.Items(3);
  return (Eigen::AngleAxisd(angles[2].AsAngle(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(angles[1].AsAngle(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles[0].AsAngle(), Eigen::Vector3d::UnitX()))
      .matrix();
}

Eigen::Matrix3d QuaternionOf(const YamlNode& node) {
  const std::vector<double> values = node.Values<double>(4);
  const Eigen::Quaterniond rotation(values[3], values[0], values[1], values[2]);
  if (!(std::abs(rotation.norm() - 1) < 0.01)) {
    node.Fail("the quaternion x, y, z, w must have the length 1");
  }
  return rotation.normalized().matrix();
}

double SigmaOf(const YamlNode& node, double value) {
  if (!(value > 0) || !std::isfinite(value)) node.Fail("must be positive");
  return value;
}

SurveyedBoard ReadBoard(const YamlNode& node) {
  YamlMap map(node);
  SurveyedBoard board;
  board.board = map.Get<std::string>("board");
  const YamlNode position = map.Required("position");
  const std::vector<double> values = position.Values<double>(3);
  board.base_from_board.translation() = Eigen::Vector3d(values[0], values[1], values[2]);
  constexpr double kFarthest = 200;
  if (!(board.base_from_board.translation().norm() < kFarthest)) {
    position.Fail("is hundreds of metres away; give metres, not millimetres");
  }
  const std::optional<YamlNode> rotation = map.Optional("rotation");
  const std::optional<YamlNode> quaternion = map.Optional("quaternion");
  if (rotation && quaternion) quaternion->Fail("give either 'rotation' or 'quaternion'");
  if (rotation) board.base_from_board.linear() = RotationOf(*rotation);
  if (quaternion) board.base_from_board.linear() = QuaternionOf(*quaternion);
  if (const auto sigma = map.Optional("position_sigma")) {
    board.position_sigma = SigmaOf(*sigma, sigma->As<double>());
  }
  if (const auto sigma = map.Optional("rotation_sigma")) {
    board.rotation_sigma = SigmaOf(*sigma, sigma->AsAngle());
  }
  map.Finish();
  return board;
}

}  // namespace

absl::StatusOr<std::vector<SurveyedBoard>> SurveyFromText(const std::string& text,
                                                          const std::string& file) {
  try {
    std::vector<SurveyedBoard> boards;
    std::set<std::string> names;
    for (const YamlNode& node : YamlNode::FromText(text, file).Items()) {
      boards.push_back(ReadBoard(node));
      if (!names.insert(boards.back().board).second) {
        node.Fail("board '" + boards.back().board + "' is there twice");
      }
    }
    return boards;
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

}  // namespace silhouette
