#include "calib/poses/robot_pose_file.h"

#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/boards/csv.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr double kRobotPoseFarthestFlange = 50;  // metres; what is further away is in millimetres

const std::vector<std::string>& Columns() {
  static const std::vector<std::string> columns = {"frame", "tx", "ty", "tz",
                                                   "qx",    "qy", "qz", "qw"};
  return columns;
}

absl::Status Mistake(const CsvRow& row, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(row.place(), ": ", what));
}

absl::StatusOr<RobotPose> PoseOf(const CsvRow& row) {
  std::array<double, 7> values{};
  for (size_t i = 0; i < values.size(); ++i) {
    ASSIGN_OR_RETURN(const double value, row.Number(i + 1));
    values[i] = value;
  }
  RobotPose pose{.frame = row.Text(0)};
  if (pose.frame.empty()) return Mistake(row, "the frame has no name");
  const Eigen::Vector3d position(values[0], values[1], values[2]);
  if (position.norm() > kRobotPoseFarthestFlange) {
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
    ASSIGN_OR_RETURN(RobotPose pose, PoseOf(row));
    const auto [other, added] = places.emplace(pose.frame, row.place());
    if (!added) {
      return Mistake(row, absl::StrCat("frame '", pose.frame, "' is there already, at ",
                                       other->second, "; leave one"));
    }
    poses.push_back(std::move(pose));
  }
  return poses;
}

}  // namespace silhouette
