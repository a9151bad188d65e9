// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/files.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <system_error>

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
#include "tools/program/program.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

constexpr double kFullTurn = 2 * 3.14159265358979323846;

// The value of the joint `name`, in radians or metres.
absl::StatusOr<double> JointValue(const RobotModel& robot, AngleUnit unit, const std::string& name,
                                  const CsvRow& row, size_t column) {
  const std::optional<size_t> joint = robot.JointIndex(name);
  const bool turns = !joint || robot.joints()[*joint].type != JointType::kPrismatic;
  const bool stated = unit != AngleUnit::kRadians || StatesUnit(row.Text(column));
  double value = 0;
  try {
    value = ParseJointValue(row.Text(column), turns ? unit : AngleUnit::kRadians);
  } catch (const std::invalid_argument& error) {
    return InvalidArgument(row.place(), ": '", name, "': ", error.what());
  }
  // RobotModel::Positions looks at the limits of what does not look like degrees.
  if (!joint || !turns || stated || std::abs(value) <= 1.01 * kFullTurn) return value;
  const RobotJoint& of_model = robot.joints()[*joint];
  const bool has_limits = of_model.type != JointType::kContinuous;
  if (has_limits && value >= of_model.lower && value <= of_model.upper) return value;
  return InvalidArgument(absl::StrFormat(
      "%s: '%s' is %g rad, more than a full turn; if it is in degrees write %sdeg, or give "
      "--degrees; if it is in radians write %srad",
      row.place(), name, value, row.Text(column), row.Text(column)));
}

}  // namespace

absl::StatusOr<std::vector<Board>> ReadBoards(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  return BoardsFromText(text, file);
}

absl::StatusOr<std::vector<TagSighting>> ReadSightings(const std::string& file, double sigma) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  ASSIGN_OR_RETURN(std::vector<TagSighting> sightings, SightingsFromText(text, file));
  if (sigma == 0) return sightings;
  for (TagSighting& sighting : sightings) sighting.sigma = sigma;
  return sightings;
}

void AddSigmaOption(CLI::App& command, double& sigma) {
  command
      .add_option("--sigma", sigma,
                  "Standard deviation of all corners per axis, in pixels; default: each tag's in "
                  "--corners, by the image's noise. State more where print, paper or lens err")
      ->check(PositiveNumber());
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
  return InvalidArgument(option, " '", text, "' is not WIDTHxHEIGHT in pixels, e.g. 640x480");
}

CLI::Validator SizeInPixels() {
  return CLI::Validator(
      [](const std::string& text) {
        return std::string(
            SizeFromText(text.substr(text.rfind('=') + 1), "size").status().message());
      },
      "");
}

std::vector<size_t> JointsTo(const RobotModel& robot, size_t link) {
  std::vector<size_t> joints;
  for (int i = static_cast<int>(link); i >= 0; i = robot.links()[static_cast<size_t>(i)].parent) {
    const int joint = robot.links()[static_cast<size_t>(i)].joint;
    if (joint < 0 || std::ranges::count(joints, static_cast<size_t>(joint)) > 0) continue;
    joints.insert(joints.begin(), static_cast<size_t>(joint));
  }
  return joints;
}

absl::StatusOr<size_t> FlangeLink(const RobotModel& robot, const std::string& name) {
  std::vector<std::string> names;
  for (size_t i = 0; i < robot.links().size(); ++i) {
    names.push_back(robot.links()[i].name);
    if (names.back() == (name.empty() ? "flange" : name)) return i;
  }
  if (!name.empty()) {
    return InvalidArgument("the robot has no link '", name, "'; it has ", ListOfWords(names));
  }
  size_t flange = 0;
  size_t most = 0;
  for (size_t i = 0; i < robot.links().size(); ++i) {
    const size_t joints = JointsTo(robot, i).size();
    if (joints >= most) flange = i;
    most = std::max(most, joints);
  }
  return flange;
}

std::string GuessedFlangeLink(const RobotModel& robot, const std::string& name) {
  const absl::StatusOr<size_t> flange = FlangeLink(robot, name);
  if (!name.empty() || !flange.ok() || robot.links()[*flange].name == "flange") return "";
  return absl::StrCat("no link is named 'flange': the link '", robot.links()[*flange].name,
                      "', which most joints move, is taken for it; if it is another, name it "
                      "(--flange-link)");
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
    return NotFound("the folder '", folder, "' cannot be read: ", error.message());
  }
  if (files.empty()) {
    return NotFound("there is no camera model (VIEW", kCameraFileExtension, ") in '", folder, "'");
  }
  std::ranges::sort(files);
  std::vector<CameraFile> cameras;
  for (const fs::path& file : files) {
    ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file.string()));
    ASSIGN_OR_RETURN(const CameraModel camera, CameraFromText(text, file.string()));
    ASSIGN_OR_RETURN(const auto known, LensRegionFromText(text, file.string()));
    cameras.push_back({ViewOfCameraFile(file.string()), camera, known});
  }
  return cameras;
}

absl::StatusOr<std::string> WriteCameraFile(const std::string& folder, const std::string& view,
                                            const CameraModel& camera,
                                            const std::optional<LensRegion>& known) {
  RETURN_IF_ERROR(MakeFolder(folder));
  const std::string path = (fs::path(folder) / CameraFileName(view)).string();
  RETURN_IF_ERROR(WriteWholeFile(path, CameraFileText(camera, view, known)));
  return path;
}

absl::StatusOr<std::vector<RobotPose>> RobotPosesOfJoints(const std::string& text,
                                                          const std::string& file,
                                                          const RobotModel& robot,
                                                          const JointFileSettings& settings) {
  ASSIGN_OR_RETURN(const size_t flange, FlangeLink(robot, settings.flange_link));
  if (text.empty()) {
    return InvalidArgument(
        file, ": the file is empty; its first line is frame and the names of the joints");
  }
  std::vector<std::string> columns = {"frame"};
  for (const std::string& name : CsvColumns(text)) {
    if (name != "frame") columns.push_back(name);
  }
  ASSIGN_OR_RETURN(const std::vector<CsvRow> rows, CsvRows(text, file, columns));
  std::vector<std::string> joints(columns.begin() + 1, columns.end());
  std::vector<double> fixed;
  for (const FixedJoint& joint : settings.fixed_joints) {
    if (std::ranges::find(columns, joint.name) != columns.end()) continue;
    joints.push_back(joint.name);
    fixed.push_back(joint.position);
  }
  std::vector<RobotPose> poses;
  std::map<std::string, std::string> places;
  for (const CsvRow& row : rows) {
    const auto [other, added] = places.emplace(row.Text(0), row.place());
    if (!added) {
      return InvalidArgument(row.place(), ": frame '", row.Text(0), "' is there already, at ",
                             other->second, "; leave one");
    }
    std::vector<double> values;
    for (size_t i = 1; i < columns.size(); ++i) {
      ASSIGN_OR_RETURN(const double value, JointValue(robot, settings.unit, columns[i], row, i));
      values.push_back(value);
    }
    values.insert(values.end(), fixed.begin(), fixed.end());
    const absl::StatusOr<std::vector<double>> positions = robot.Positions(joints, values);
    if (!positions.ok()) {
      return InvalidArgument(row.place(), ": ", positions.status().message());
    }
    poses.push_back({row.Text(0), robot.LinkPoses(*positions)[flange]});
  }
  return poses;
}

}  // namespace silhouette
