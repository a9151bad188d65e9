// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/files.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "calib/boards/board.h"
#include "calib/boards/csv.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_message.h"
#include "calib/files/camera_file.h"
#include "common/picture/files.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

constexpr double kFullTurn = 2 * 3.14159265358979323846;

// The names in a table's first line.
std::vector<std::string> HeaderOf(const std::string& text) {
  const std::string line = text.substr(0, text.find('\n'));
  std::vector<std::string> names;
  for (absl::string_view name : absl::StrSplit(line, ',')) {
    names.emplace_back(absl::StripAsciiWhitespace(name));
  }
  return names;
}

// One line's values, by the names of the columns.
class JointReader {
 public:
  JointReader(const RobotModel& robot, const JointFileSettings& settings,
              std::vector<std::string> columns)
      : robot_(robot), settings_(settings), columns_(std::move(columns)) {
    for (const FixedJoint& joint : settings.fixed_joints) {
      if (std::find(columns_.begin(), columns_.end(), joint.name) == columns_.end()) {
        fixed_.push_back(joint);
      }
    }
  }

  absl::StatusOr<std::vector<double>> Positions(const CsvRow& row) const {
    std::vector<std::string> names;
    std::vector<double> values;
    for (const FixedJoint& joint : fixed_) {
      names.push_back(joint.name);
      values.push_back(joint.position);
    }
    for (size_t i = 1; i < columns_.size(); ++i) {
      ASSIGN_OR_RETURN(const double value, ValueOf(row, i));
      names.push_back(columns_[i]);
      values.push_back(value);
    }
    absl::StatusOr<std::vector<double>> positions = robot_.Positions(names, values);
    if (positions.ok()) return positions;
    return absl::InvalidArgumentError(
        absl::StrCat(row.place(), ": ", positions.status().message()));
  }

 private:
  absl::StatusOr<double> ValueOf(const CsvRow& row, size_t column) const {
    const std::optional<size_t> joint = robot_.JointIndex(columns_[column]);
    const bool turns = !joint || robot_.joints()[*joint].type != JointType::kPrismatic;
    double value = 0;
    try {
      value = ParseJointValue(row.Text(column), turns ? settings_.unit : AngleUnit::kRadians);
    } catch (const std::invalid_argument& error) {
      return absl::InvalidArgumentError(
          absl::StrCat(row.place(), ": '", columns_[column], "': ", error.what()));
    }
    if (turns && std::abs(value) > 1.01 * kFullTurn) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "%s: '%s' is %g rad, more than a full turn; if it is in degrees write %sdeg, or give "
          "--degrees",
          row.place(), columns_[column], value, row.Text(column)));
    }
    return value;
  }

  const RobotModel& robot_;
  const JointFileSettings& settings_;
  std::vector<std::string> columns_;
  std::vector<FixedJoint> fixed_;
};

}  // namespace

absl::StatusOr<std::vector<Board>> ReadBoards(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  return BoardsFromText(text, file);
}

absl::StatusOr<std::vector<TagSighting>> ReadSightings(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  return SightingsFromText(text, file);
}

absl::Status ReplaceFile(const std::string& path, const std::string& text) {
  const std::string unfinished = path + ".unfinished";
  RETURN_IF_ERROR(WriteWholeFile(unfinished, text));
  std::error_code error;
  fs::rename(unfinished, path, error);
  if (!error) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("'", path, "' cannot be written: ", error.message()));
}

std::string TextOfFiles(const std::vector<std::string>& files) {
  std::string text;
  for (const std::string& file : files) absl::StrAppend(&text, "wrote ", file, "\n");
  return text;
}

absl::StatusOr<PixelSize> SizeFromText(const std::string& text, const std::string& option) {
  const std::vector<std::string> parts = absl::StrSplit(text, 'x');
  PixelSize size;
  if (parts.size() == 2 && absl::SimpleAtoi(parts[0], &size.width) &&
      absl::SimpleAtoi(parts[1], &size.height) && size.width > 0 && size.height > 0) {
    return size;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(option, " '", text, "' is not WIDTHxHEIGHT in pixels, e.g. 640x480"));
}

absl::StatusOr<size_t> FlangeLink(const RobotModel& robot, const std::string& name) {
  std::vector<std::string> names;
  for (size_t i = 0; i < robot.links().size(); ++i) {
    names.push_back(robot.links()[i].name);
    if (names.back() == (name.empty() ? "flange" : name)) return i;
  }
  if (name.empty()) return robot.links().size() - 1;
  return absl::InvalidArgumentError(
      absl::StrCat("the robot has no link '", name, "'; it has ", ListOfWords(names)));
}

std::string ViewOfCameraFile(const std::string& path) {
  const std::string name = fs::path(path).stem().string();
  std::string view;
  for (size_t i = 0; i < name.size(); ++i) {
    int code = 0;
    if (name[i] == '%' && i + 2 < name.size() &&
        absl::SimpleHexAtoi(name.substr(i + 1, 2), &code)) {
      view += static_cast<char>(code);
      i += 2;
    } else {
      view += name[i];
    }
  }
  return view;
}

absl::StatusOr<CameraModel> ReadCameraFile(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  return CameraFromText(text, file);
}

absl::StatusOr<std::vector<CameraFile>> ReadCameraFolder(const std::string& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == kCameraFileExtension) files.push_back(entry.path());
  }
  if (error) {
    return absl::NotFoundError(
        absl::StrCat("the folder '", folder, "' cannot be read: ", error.message()));
  }
  if (files.empty()) {
    return absl::NotFoundError(absl::StrCat("there is no camera model (VIEW", kCameraFileExtension,
                                            ") in '", folder, "'"));
  }
  std::sort(files.begin(), files.end());
  std::vector<CameraFile> cameras;
  for (const fs::path& file : files) {
    ASSIGN_OR_RETURN(const CameraModel camera, ReadCameraFile(file.string()));
    cameras.push_back({ViewOfCameraFile(file.string()), camera});
  }
  return cameras;
}

absl::StatusOr<std::string> WriteCameraFile(const std::string& folder, const std::string& view,
                                            const CameraModel& camera) {
  RETURN_IF_ERROR(MakeFolder(folder));
  const std::string path = (fs::path(folder) / CameraFileName(view)).string();
  RETURN_IF_ERROR(WriteWholeFile(path, CameraFileText(camera, view)));
  return path;
}

absl::StatusOr<std::vector<RobotPose>> RobotPosesOfJoints(const std::string& text,
                                                          const std::string& file,
                                                          const RobotModel& robot,
                                                          const JointFileSettings& settings) {
  ASSIGN_OR_RETURN(const size_t flange, FlangeLink(robot, settings.flange_link));
  if (text.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        file, ": the file is empty; its first line is frame and the names of the joints"));
  }
  std::vector<std::string> columns = {"frame"};
  for (const std::string& name : HeaderOf(text)) {
    if (name != "frame") columns.push_back(name);
  }
  ASSIGN_OR_RETURN(const std::vector<CsvRow> rows, CsvRows(text, file, columns));
  const JointReader reader(robot, settings, columns);
  std::vector<RobotPose> poses;
  std::map<std::string, std::string> places;
  for (const CsvRow& row : rows) {
    const auto [other, added] = places.emplace(row.Text(0), row.place());
    if (!added) {
      return absl::InvalidArgumentError(absl::StrCat(row.place(), ": frame '", row.Text(0),
                                                     "' is there already, at ", other->second,
                                                     "; leave one"));
    }
    ASSIGN_OR_RETURN(const std::vector<double> positions, reader.Positions(row));
    poses.push_back({row.Text(0), robot.LinkPoses(positions)[flange]});
  }
  return poses;
}

}  // namespace silhouette
