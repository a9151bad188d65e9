#include "tools/silhouette-calibrate/run_record.h"

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/boards/csv.h"
#include "calib/boards/sighting_file.h"
#include "calib/poses/robot_pose_file.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

std::string PathIn(const std::string& folder, const std::string& name) {
  return (fs::path(folder) / name).string();
}

std::vector<std::string> JointColumns(const RobotModel& robot) {
  std::vector<std::string> columns{"frame"};
  for (const RobotJoint& joint : robot.joints()) columns.push_back(joint.name);
  return columns;
}

std::string JointsText(const RobotModel& robot, const SessionRecord& record) {
  std::string text = absl::StrCat(
      absl::StrJoin(JointColumns(robot), ",",
                    [](std::string* out, const std::string& s) { *out += CsvField(s); }),
      "\n");
  for (size_t f = 0; f < record.frames.size(); ++f) {
    absl::StrAppend(&text, CsvField(record.frames[f]));
    for (const double value : record.positions[f]) absl::StrAppend(&text, ",", CsvNumber(value));
    text += '\n';
  }
  return text;
}

// Never leaves half a file.
absl::Status ReplaceFile(const std::string& path, const std::string& text) {
  absl::Status written = WriteWholeFile(path + ".new", text);
  if (!written.ok()) return written;
  std::error_code error;
  fs::rename(path + ".new", path, error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(path, " cannot be written: ", error.message()));
}

}  // namespace

absl::Status WriteRecord(const std::string& folder, const RobotModel& robot,
                         const SessionRecord& record) {
  // Corners last: frames without a robot pose would be of no use, the other way round does no harm.
  absl::Status status = ReplaceFile(PathIn(folder, "joints.csv"), JointsText(robot, record));
  if (!status.ok()) return status;
  status = ReplaceFile(PathIn(folder, "robot_poses.csv"), RobotPoseFileText(record.robot_poses));
  if (!status.ok()) return status;
  return ReplaceFile(PathIn(folder, "corners.csv"), SightingFileText(record.sightings));
}

absl::StatusOr<SessionRecord> ReadRecord(const std::string& folder, const RobotModel& robot) {
  SessionRecord record;
  const std::string corners = PathIn(folder, "corners.csv");
  if (!fs::exists(corners)) return record;
  const std::string joints = PathIn(folder, "joints.csv");
  ASSIGN_OR_RETURN(const std::string joints_text, ReadWholeFile(joints));
  ASSIGN_OR_RETURN(const auto rows, CsvRows(joints_text, joints, JointColumns(robot)));
  for (const CsvRow& row : rows) {
    record.frames.push_back(row.Text(0));
    record.positions.emplace_back();
    for (size_t j = 0; j < robot.joints().size(); ++j) {
      ASSIGN_OR_RETURN(const double value, row.Number(j + 1));
      record.positions.back().push_back(value);
    }
  }
  const std::string poses = PathIn(folder, "robot_poses.csv");
  ASSIGN_OR_RETURN(const std::string poses_text, ReadWholeFile(poses));
  ASSIGN_OR_RETURN(auto robot_poses, RobotPosesFromText(poses_text, poses));
  record.robot_poses = std::move(robot_poses);
  ASSIGN_OR_RETURN(const std::string corners_text, ReadWholeFile(corners));
  ASSIGN_OR_RETURN(auto sightings, SightingsFromText(corners_text, corners));
  record.sightings = std::move(sightings);
  if (record.robot_poses.size() != record.frames.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat(poses, " has not the frames of ", joints, "; begin with an empty folder"));
  }
  return record;
}

}  // namespace silhouette
