#include "tools/silhouette-calibrate/joint_files.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "calib/boards/csv.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

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

absl::StatusOr<size_t> FlangeLink(const RobotModel& robot, const std::string& wanted) {
  std::vector<std::string> names;
  for (size_t i = 0; i < robot.links().size(); ++i) {
    names.push_back(robot.links()[i].name);
    if (names.back() == (wanted.empty() ? "flange" : wanted)) return i;
  }
  if (wanted.empty()) return robot.links().size() - 1;
  return absl::InvalidArgumentError(
      absl::StrCat("the robot has no link '", wanted, "'; it has ", ListOfWords(names)));
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
