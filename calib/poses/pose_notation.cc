// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_notation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/poses/pose_problem.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kNearestFlange = 0.02;  // metres; where the farthest is nearer, the unit is wrong

const std::map<std::string, double>& Lengths() {
  static const std::map<std::string, double> units = {{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}};
  return units;
}

const std::map<std::string, double>& Angles() {
  static const std::map<std::string, double> units = {{"rad", 1}, {"deg", kDegree}};
  return units;
}

std::vector<std::string> MatrixColumns() {
  std::vector<std::string> columns;
  for (int i = 0; i < 16; ++i) columns.push_back(absl::StrCat("m", i / 4, i % 4));
  return columns;
}

absl::StatusOr<Matrix3d> MatrixOf(std::span<const double> values) {
  if (values.size() == 13 && (std::abs(values[9]) > 1e-6 || std::abs(values[10]) > 1e-6 ||
                              std::abs(values[11]) > 1e-6 || std::abs(values[12] - 1) > 1e-6)) {
    return InvalidArgument("the matrix's last row is not 0 0 0 1; give its rows one after another");
  }
  const Matrix3d given =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.data());
  if (!(given * given.transpose()).isIdentity(0.02) || !(given.determinant() > 0)) {
    return InvalidArgument("the matrix's first three columns are no rotation");
  }
  return Matrix3d(Eigen::Quaterniond(given).normalized().matrix());
}

}  // namespace

struct PoseNotation::Known {
  const char* name;
  std::vector<std::string> columns;
  Rotation rotation;
  const char* units;  // empty: none of its own
};

const std::vector<PoseNotation::Known>& PoseNotation::All() {
  static const std::vector<Known> all = {
      {"quaternion", {"tx", "ty", "tz", "qx", "qy", "qz", "qw"}, Rotation::kQuaternion, "m"},
      {"tum", {"tx", "ty", "tz", "qx", "qy", "qz", "qw"}, Rotation::kQuaternion, "m"},
      {"rotation_vector", {"x", "y", "z", "rx", "ry", "rz"}, Rotation::kVector, ""},
      {"rpy", {"x", "y", "z", "roll", "pitch", "yaw"}, Rotation::kZyxReversed, ""},
      {"matrix", MatrixColumns(), Rotation::kMatrix, ""},
      {"kuka", {"x", "y", "z", "a", "b", "c"}, Rotation::kZyx, "mm,deg"},
      {"abb", {"x", "y", "z", "q1", "q2", "q3", "q4"}, Rotation::kQuaternion, "mm"},
      {"ur", {"x", "y", "z", "rx", "ry", "rz"}, Rotation::kVector, "m,rad"},
      {"staubli", {"x", "y", "z", "rx", "ry", "rz"}, Rotation::kXyz, "mm,deg"},
      {"fanuc", {"x", "y", "z", "w", "p", "r"}, Rotation::kZyxReversed, "mm,deg"}};
  return all;
}

std::vector<std::string> PoseNotation::Names() {
  std::vector<std::string> names;
  for (const Known& known : All()) names.emplace_back(known.name);
  return names;
}

absl::StatusOr<PoseNotation> PoseNotation::Named(const std::string& name,
                                                 const std::string& units) {
  const auto known =
      std::ranges::find_if(All(), [&](const Known& one) { return name == one.name; });
  if (known == All().end()) {
    return InvalidArgument("there is no notation of poses '", name, "'; known are ",
                           absl::StrJoin(Names(), ", "));
  }
  PoseNotation notation;
  notation.name_ = name;
  notation.columns_ = known->columns;
  notation.rotation_ = known->rotation;
  notation.real_first_ = name == "abb";
  notation.units_stated_ = !units.empty();
  const bool angles = notation.has_angles();
  const std::string example = angles ? "mm,deg" : "mm";
  if (units.empty() && *known->units == '\0') {
    return InvalidArgument("poses as '", name, "' have no units of their own; state them, e.g. ",
                           example);
  }
  const std::vector<std::string> stated = absl::StrSplit(units.empty() ? known->units : units, ',');
  if (stated.size() != (angles ? 2u : 1u) || !Lengths().contains(stated[0]) ||
      (angles && !Angles().contains(stated[1]))) {
    return InvalidArgument("'", units, "' are no units of poses as '", name, "'; give m, cm or mm",
                           angles ? " and rad or deg" : "", ", e.g. ", example);
  }
  notation.metres_ = Lengths().at(stated[0]);
  if (angles) notation.radians_ = Angles().at(stated[1]);
  return notation;
}

absl::StatusOr<Matrix3d> PoseNotation::RotationOf(std::span<const double> values) const {
  if (rotation_ == Rotation::kMatrix) return MatrixOf(values);
  if (rotation_ == Rotation::kQuaternion) {
    const size_t w = real_first_ ? 0 : 3;
    const size_t x = real_first_ ? 1 : 0;
    const Eigen::Quaterniond rotation(values[w], values[x], values[x + 1], values[x + 2]);
    if (std::abs(rotation.norm() - 1) <= 0.01) return rotation.normalized().matrix();
    return InvalidArgument(absl::StrFormat(
        "the quaternion's length is %.4g, not 1; give %s (not angles, nor a rotation vector)",
        rotation.norm(), absl::StrJoin(columns_.begin() + 3, columns_.end(), ", ")));
  }
  const Vector3d angles = radians_ * Vector3d(values[0], values[1], values[2]);
  if (rotation_ == Rotation::kVector) {
    return AngleAxisd(angles.norm(), angles.stableNormalized()).toRotationMatrix();
  }
  const auto turned = [](double a, const Vector3d& axis) { return AngleAxisd(a, axis); };
  if (rotation_ == Rotation::kXyz) {
    return Matrix3d(turned(angles[0], Vector3d::UnitX()) * turned(angles[1], Vector3d::UnitY()) *
                    turned(angles[2], Vector3d::UnitZ()));
  }
  const bool reversed = rotation_ == Rotation::kZyxReversed;
  return Matrix3d(turned(angles[reversed ? 2 : 0], Vector3d::UnitZ()) *
                  turned(angles[1], Vector3d::UnitY()) *
                  turned(angles[reversed ? 0 : 2], Vector3d::UnitX()));
}

absl::StatusOr<Eigen::Isometry3d> PoseNotation::Pose(std::span<const double> values) const {
  const bool matrix = rotation_ == Rotation::kMatrix;
  if (values.size() != columns_.size() && !(matrix && values.size() == 12)) {
    return InvalidArgument("a pose as '", name_, "' is ", columns_.size(), matrix ? " or 12" : "",
                           " numbers, not ", values.size());
  }
  Vector3d position(values[0], values[1], values[2]);
  std::vector<double> turn(values.begin() + 3, values.end());
  if (matrix) {
    position = {values[3], values[7], values[11]};
    turn.clear();
    for (const int from : {0, 4, 8}) {
      turn.insert(turn.end(), values.begin() + from, values.begin() + from + 3);
    }
    turn.insert(turn.end(), values.begin() + 12, values.end());
  }
  position *= metres_;
  if (!(position.norm() <= kFarthestFlange)) {
    return InvalidArgument(absl::StrFormat(
        "the flange is %.0f m from the robot's base; positions look like %s", position.norm(),
        metres_ == 1 ? "millimetres, give metres" : "those of a smaller unit, state it"));
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  ASSIGN_OR_RETURN(pose.linear(), RotationOf(turn));
  pose.translation() = position;
  return pose;
}

absl::Status PoseNotation::CheckUnits(std::span<const std::vector<double>> rows) const {
  if (rows.empty() || rotation_ == Rotation::kMatrix) return absl::OkStatus();
  double farthest = 0;
  double widest = 0;
  for (const std::vector<double>& values : rows) {
    farthest = std::max(farthest, Vector3d(values[0], values[1], values[2]).norm());
    for (size_t i = 3; i < values.size(); ++i) widest = std::max(widest, std::abs(values[i]));
  }
  const bool degrees = radians_ != 1;
  if (has_angles() && !degrees && widest > 2.2 * std::numbers::pi) {
    return InvalidArgument(absl::StrFormat(
        "an angle of %.4g rad is more than a turn; if angles are in degrees, state the units so",
        widest));
  }
  if (units_stated_) return absl::OkStatus();
  if (metres_ < 1 && farthest * metres_ < kNearestFlange) {
    return InvalidArgument(absl::StrFormat(
        "the flange is never farther than %.1f mm from the robot's base; if positions are in "
        "metres, state the units",
        1000 * farthest * metres_));
  }
  if (has_angles() && degrees && widest <= std::numbers::pi) {
    return InvalidArgument(absl::StrFormat(
        "no angle is greater than %.3g degrees; if angles are in radians, state the units",
        widest));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
