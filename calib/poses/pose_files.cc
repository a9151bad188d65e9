// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_files.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "calib/boards/csv.h"
#include "calib/poses/pose_frames.h"
#include "calib/poses/pose_table.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// What a file says of one frame.
struct PoseRow {
  std::string place;  // for messages
  std::string frame;
  std::vector<double> values;
};

absl::StatusOr<double> NumberFrom(absl::string_view text, const std::string& place) {
  double value = 0;
  if (absl::SimpleAtod(text, &value) && std::isfinite(value)) return value;
  return InvalidArgument(place, ": '", text, "' is not a finite number");
}

absl::StatusOr<std::vector<PoseRow>> RowsOfTable(const std::string& text, const std::string& file,
                                                 const PoseNotation& notation) {
  ASSIGN_OR_RETURN(const PoseTable table, PoseTableOf(text, file, notation));
  // Robots name them in capitals, too.
  const CsvHeader header = table.named ? CsvHeader::kAnyCase : CsvHeader::kNone;
  ASSIGN_OR_RETURN(const std::vector<CsvRow> lines,
                   CsvRows(table.csv, file, table.columns, header));
  std::vector<PoseRow> rows;
  for (const CsvRow& line : lines) {
    const size_t first = table.has_frames ? 1 : 0;
    rows.push_back(
        {line.place(), table.has_frames ? line.Text(0) : NameOfRow(rows.size() + 1), {}});
    for (size_t i = first; i < table.columns.size(); ++i) {
      ASSIGN_OR_RETURN(const double value, line.Number(i));
      rows.back().values.push_back(value);
    }
  }
  return rows;
}

// Of lists as Python and numpy print them, where that is no JSON: each innermost one is a line.
absl::StatusOr<std::vector<PoseRow>> RowsOfPrinted(const std::string& text, const std::string& file,
                                                   const PoseNotation& notation) {
  std::string numbers;  // without comments
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    absl::StrAppend(&numbers, line.substr(0, line.find('#')), " ");
  }
  if (std::ranges::count(numbers, '[') != std::ranges::count(numbers, ']') ||
      std::ranges::count(numbers, '(') != std::ranges::count(numbers, ')')) {
    return InvalidArgument(file, ": the list is cut off: a bracket is not closed; write it again");
  }
  const std::string lines = absl::StrReplaceAll(numbers, {{"np.array", ""},
                                                          {"array", ""},
                                                          {"dtype=float32", ""},
                                                          {"dtype=float64", ""},
                                                          {",", " "},
                                                          {"]", "\n"},
                                                          {")", "\n"}});
  absl::StatusOr<std::vector<PoseRow>> rows = RowsOfTable(lines, file, notation);
  if (!rows.ok()) {
    return InvalidArgument(file, ": no poses as '", notation.name(),
                           "' in the lists that Python printed; write them with "
                           "numpy.savetxt(FILE, numpy.reshape(POSES, (len(POSES), -1)))");
  }
  for (PoseRow& row : *rows) {
    row.place = absl::StrCat(file, ", pose ", 1 + (&row - rows->data()));
  }
  return rows;
}

void AppendNumbers(const nlohmann::json& json, std::vector<double>& values) {
  if (json.is_array()) {
    for (const nlohmann::json& item : json) AppendNumbers(item, values);
  } else {
    values.push_back(json.get<double>());
  }
}

std::string FrameOf(const nlohmann::json& json) {
  const nlohmann::json& frame = json.at("frame");
  return frame.is_string() ? frame.get<std::string>() : frame.dump();
}

// A pose as ROS writes it, {"position": {"x": ...}, "orientation": {...}}.
bool IsRosPose(const nlohmann::json& json) {
  return json.is_object() && json.contains("position") && json.contains("orientation");
}

void AppendRosPose(const nlohmann::json& json, std::vector<double>& values) {
  for (const char* key : {"x", "y", "z"}) values.push_back(json.at("position").at(key));
  for (const char* key : {"x", "y", "z", "w"}) values.push_back(json.at("orientation").at(key));
}

// `twice`: a name that an object has twice, of which the last one alone is kept.
nlohmann::ordered_json JsonOf(const std::string& text, std::optional<std::string>& twice) {
  std::vector<std::set<std::string>> names;  // by object that is open
  return nlohmann::ordered_json::parse(
      text, [&](int, nlohmann::json::parse_event_t event, const nlohmann::ordered_json& read) {
        using Event = nlohmann::json::parse_event_t;
        if (event == Event::object_start) names.emplace_back();
        if (event == Event::object_end) names.pop_back();
        if (event != Event::key) return true;
        const auto [name, added] = names.back().insert(read.get<std::string>());
        if (!added) twice = *name;
        return true;
      });
}

absl::StatusOr<std::vector<PoseRow>> RowsOfJson(const std::string& text, const std::string& file,
                                                const PoseNotation& notation) {
  try {
    std::optional<std::string> twice;
    const nlohmann::ordered_json json = JsonOf(text, twice);
    if (twice) return InvalidArgument(file, ": '", *twice, "' is there twice; leave one");
    std::vector<PoseRow> rows;
    for (const auto& [key, value] : json.items()) {
      PoseRow row{.place = file, .frame = key, .values = {}};
      if (IsRosPose(value) && notation.columns() == PoseNotation().columns()) {
        AppendRosPose(value, row.values);
        if (!json.is_object()) row.frame = NameOfRow(rows.size() + 1);
        if (value.contains("frame")) row.frame = FrameOf(value);
      } else if (json.is_object() || value.is_array()) {
        AppendNumbers(value, row.values);
        if (!json.is_object()) row.frame = NameOfRow(rows.size() + 1);
      } else {
        row.frame = FrameOf(value);
        for (const std::string& column : notation.columns()) {
          row.values.push_back(value.at(column).get<double>());
        }
      }
      row.place = absl::StrCat(file, ", frame '", row.frame, "'");
      rows.push_back(std::move(row));
    }
    return rows;
  } catch (const nlohmann::json::exception& error) {
    return InvalidArgument(file,
                           ": no poses as JSON, which are {\"FRAME\": [NUMBERS], ...} or "
                           "[{\"frame\": \"FRAME\", \"",
                           notation.columns().front(),
                           "\": 0, ...}, ...], as Python's json.dump writes them: ", error.what());
  }
}

absl::StatusOr<std::vector<RobotPose>> PosesOf(const std::vector<PoseRow>& rows,
                                               const std::string& file,
                                               const PoseNotation& notation) {
  std::vector<RobotPose> poses;
  std::vector<std::vector<double>> values;
  std::map<std::string, std::string> places;
  for (const PoseRow& row : rows) {
    if (row.frame.empty()) return InvalidArgument(row.place, ": the frame has no name");
    const auto pose = notation.Pose(row.values);
    if (!pose.ok()) return InvalidArgument(row.place, ": ", pose.status().message());
    const auto [other, added] = places.emplace(row.frame, row.place);
    if (!added) {
      return InvalidArgument(row.place, ": frame '", row.frame, "' is there already, at ",
                             other->second, "; leave one");
    }
    poses.push_back({row.frame, *pose});
    values.push_back(row.values);
  }
  const absl::Status units = notation.CheckUnits(values);
  if (!units.ok()) return InvalidArgument(file, ": ", units.message());
  return poses;
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

absl::StatusOr<std::vector<RobotPose>> RobotPosesFromText(const std::string& given,
                                                          const std::string& file,
                                                          const PoseNotation& notation) {
  if (absl::StartsWith(given, "\x93NUMPY")) {
    return InvalidArgument(file,
                           ": is numpy's binary file; write it as text with numpy.savetxt('poses."
                           "txt', numpy.reshape(POSES, (len(POSES), -1)))");
  }
  const std::string text = WithoutRobotSyntax(given, notation);
  const absl::string_view begin = absl::StripLeadingAsciiWhitespace(text);
  const bool lists = absl::StartsWith(begin, "[");
  const bool json = absl::StartsWith(begin, "{") ||
                    (lists && (absl::StrContains(begin, '{') || nlohmann::json::accept(text)));
  const bool printed =
      lists || absl::StartsWith(begin, "array(") || absl::StartsWith(begin, "np.array(");
  ASSIGN_OR_RETURN(const std::vector<PoseRow> rows, json      ? RowsOfJson(text, file, notation)
                                                    : printed ? RowsOfPrinted(text, file, notation)
                                                              : RowsOfTable(text, file, notation));
  return PosesOf(rows, file, notation);
}

absl::StatusOr<std::vector<RobotPose>> RobotPosesFromTexts(const std::vector<PoseText>& texts,
                                                           const PoseNotation& notation) {
  std::vector<PoseRow> rows;
  for (const PoseText& one : texts) {
    rows.push_back({one.file, one.frame, {}});
    for (const std::string& word : PoseFields(one.text)) {
      ASSIGN_OR_RETURN(const double value, NumberFrom(word, one.file));
      rows.back().values.push_back(value);
    }
  }
  return PosesOf(rows, texts.empty() ? "" : texts.front().file, notation);
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
