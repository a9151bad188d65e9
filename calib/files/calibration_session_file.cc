// SPDX-License-Identifier: Apache-2.0
#include "calib/files/calibration_session_file.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// The place of the view that `node` names; throws YamlError, naming those that are there.
int ViewByName(const YamlNode& node, const storage::v1::CellDescription& cell) {
  const std::string name = node.As<std::string>();
  std::vector<std::string> views;
  for (int i = 0; i < cell.views_size(); ++i) {
    if (cell.views(i).name() == name) return i;
    views.push_back(cell.views(i).name());
  }
  node.Fail(absl::StrCat("there is no view '", name, "'; the views are ", ListOfWords(views)));
}

storage::v1::FundamentalMatrix ReadMatrix(const YamlNode& node,
                                          const storage::v1::CellDescription& cell) {
  YamlMap map(node);
  storage::v1::FundamentalMatrix matrix;
  matrix.set_view_a(ViewByName(map.Required("view_a"), cell));
  matrix.set_view_b(ViewByName(map.Required("view_b"), cell));
  for (const YamlNode& row : map.Required("F").Items(3)) {
    for (const double value : row.Values<double>(3)) matrix.add_f(value);
  }
  map.Finish();
  if (matrix.view_a() == matrix.view_b()) {
    node.Fail("view_a and view_b are the same view; a matrix is for two different ones");
  }
  return matrix;
}

// The list of fundamental matrices; throws YamlError.
storage::v1::Calibration MatricesFromYaml(const YamlNode& list,
                                          const storage::v1::CellDescription& cell) {
  storage::v1::Calibration calibration;
  std::set<std::pair<int, int>> pairs;
  for (const YamlNode& item : list.Items()) {
    storage::v1::FundamentalMatrix matrix = ReadMatrix(item, cell);
    if (!pairs.insert(std::minmax({matrix.view_a(), matrix.view_b()})).second) {
      item.Fail(absl::StrCat("views '", cell.views(matrix.view_a()).name(), "' and '",
                             cell.views(matrix.view_b()).name(),
                             "' have a matrix already; keep one of the two"));
    }
    *calibration.add_fundamental_matrices() = std::move(matrix);
  }
  if (calibration.fundamental_matrices().empty()) list.Fail("there is no fundamental matrix");
  return calibration;
}

}  // namespace

std::string MatrixFileText(const storage::v1::Calibration& calibration,
                           const storage::v1::CellDescription& cell) {
  std::string text =
      "# x_b' F x_a = 0 for the images of one point; mask pixels, integers at pixel centres.\n";
  for (const storage::v1::FundamentalMatrix& matrix : calibration.fundamental_matrices()) {
    absl::StrAppend(&text, "- view_a: ", YamlQuoted(cell.views(matrix.view_a()).name()),
                    "\n  view_b: ", YamlQuoted(cell.views(matrix.view_b()).name()), "\n  F:\n");
    for (int row = 0; row < 3; ++row) {
      absl::StrAppendFormat(&text, "    - [%.17g, %.17g, %.17g]\n", matrix.f(3 * row),
                            matrix.f(3 * row + 1), matrix.f(3 * row + 2));
    }
  }
  return text;
}

absl::StatusOr<storage::v1::Calibration> MatricesFromText(
    const std::string& text, const std::string& file, const storage::v1::CellDescription& cell) {
  try {
    return MatricesFromYaml(YamlNode::FromText(text, file), cell);
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

namespace {

using storage::v1::CalibrationFigure;
using storage::v1::CalibrationRecord;
using storage::v1::CellDescription;
using storage::v1::FixedTag;

constexpr int kVersion = 1;

std::string FiguresText(const CalibrationRecord& record) {
  if (record.figures().empty()) return "";
  std::string text = "figures:\n";
  for (const CalibrationFigure& figure : record.figures()) {
    absl::StrAppend(&text, "  - {name: ", YamlQuoted(figure.name()));
    if (!figure.of().empty()) absl::StrAppend(&text, ", of: ", YamlQuoted(figure.of()));
    absl::StrAppendFormat(&text, ", value: %.17g", figure.value());
    if (!figure.unit().empty()) absl::StrAppend(&text, ", unit: ", YamlQuoted(figure.unit()));
    absl::StrAppend(&text, "}\n");
  }
  return text;
}

std::string TagsText(const CalibrationRecord& record, const CellDescription& cell) {
  if (record.fixed_tags().empty()) return "";
  std::string text = "fixed_tags:\n";
  for (const FixedTag& tag : record.fixed_tags()) {
    absl::StrAppend(&text, "  - {view: ", YamlQuoted(cell.views(tag.view()).name()),
                    ", family: ", YamlQuoted(tag.family()), ", tag: ", tag.tag());
    absl::StrAppendFormat(&text, ", sigma: %.17g,\n     corners: [", tag.sigma());
    for (int i = 0; i + 1 < tag.corners_size(); i += 2) {
      absl::StrAppendFormat(&text, "%s[%.17g, %.17g]", i == 0 ? "" : ", ", tag.corners(i),
                            tag.corners(i + 1));
    }
    absl::StrAppend(&text, "]}\n");
  }
  return text;
}

// The file of a camera per view, "" where there is none.
std::vector<std::string> ReadViews(const YamlNode& node, const CellDescription& cell) {
  std::vector<std::string> files(static_cast<size_t>(cell.views_size()));
  std::vector<bool> there(files.size());
  bool some = false;
  for (const YamlNode& item : node.Items()) {
    YamlMap map(item);
    const YamlNode name = map.Required("name");
    const auto view = static_cast<size_t>(ViewByName(name, cell));
    if (there[view]) name.Fail("the view is there twice");
    there[view] = true;
    files[view] = map.Get<std::string>("camera", "");
    some = some || !files[view].empty();
    map.Finish();
  }
  for (size_t view = 0; view < files.size(); ++view) {
    const std::string& name = cell.views(static_cast<int>(view)).name();
    if (!there[view]) node.Fail(absl::StrCat("the view '", name, "' of the cell is missing"));
    if (some && files[view].empty()) {
      node.Fail(absl::StrCat("the view '", name, "' has no camera, but others have"));
    }
  }
  if (!some) files.clear();
  return files;
}

CalibrationFigure ReadFigure(const YamlNode& node) {
  YamlMap map(node);
  CalibrationFigure figure;
  figure.set_name(map.Get<std::string>("name"));
  figure.set_of(map.Get<std::string>("of", ""));
  figure.set_value(map.Get<double>("value"));
  figure.set_unit(map.Get<std::string>("unit", ""));
  map.Finish();
  return figure;
}

FixedTag ReadTag(const YamlNode& node, const CellDescription& cell) {
  YamlMap map(node);
  FixedTag tag;
  tag.set_view(ViewByName(map.Required("view"), cell));
  tag.set_family(map.Get<std::string>("family"));
  tag.set_tag(map.Get<int>("tag"));
  tag.set_sigma(map.Get<double>("sigma"));
  const YamlNode corners = map.Required("corners");
  if (corners.Items().size() != 1) corners.Items(4);
  for (const YamlNode& corner : corners.Items()) {
    for (const double value : corner.Values<double>(2)) tag.add_corners(value);
  }
  map.Finish();
  return tag;
}

CalibrationSession ReadSession(const YamlNode& root, const CellDescription& cell) {
  YamlMap map(root);
  const YamlNode version = map.Required("calibration");
  if (version.As<int>() != kVersion) {
    version.Fail(absl::StrCat("this is version ", version.As<int>(),
                              " of the format; this program reads ", kVersion));
  }
  CalibrationSession session;
  session.camera_files = ReadViews(map.Required("views"), cell);
  if (const auto pairs = map.Optional("pairs")) {
    session.calibration = MatricesFromYaml(*pairs, cell);
  } else if (session.camera_files.empty()) {
    root.Fail("there are neither cameras in 'views' nor 'pairs'");
  }
  CalibrationRecord& record = *session.calibration.mutable_record();
  record.set_time(map.Get<std::string>("time", ""));
  record.set_program(map.Get<std::string>("program", ""));
  if (const auto figures = map.Optional("figures")) {
    for (const YamlNode& item : figures->Items()) *record.add_figures() = ReadFigure(item);
  }
  if (const auto warnings = map.Optional("warnings")) {
    for (const auto& text : warnings->Values<std::string>()) record.add_warnings(text);
  }
  if (const auto tags = map.Optional("fixed_tags")) {
    for (const YamlNode& item : tags->Items()) *record.add_fixed_tags() = ReadTag(item, cell);
  }
  map.Finish();
  return session;
}

}  // namespace

std::string SessionFileText(const CalibrationSession& session, const CellDescription& cell) {
  const CalibrationRecord& record = session.calibration.record();
  std::string text = absl::StrCat("calibration: ", kVersion, "\n");
  if (!record.time().empty()) absl::StrAppend(&text, "time: ", YamlQuoted(record.time()), "\n");
  if (!record.program().empty()) {
    absl::StrAppend(&text, "program: ", YamlQuoted(record.program()), "\n");
  }
  absl::StrAppend(&text, "views:\n");
  for (int i = 0; i < cell.views_size(); ++i) {
    absl::StrAppend(&text, "  - {name: ", YamlQuoted(cell.views(i).name()));
    if (!session.camera_files.empty()) {
      absl::StrAppend(&text,
                      ", camera: ", YamlQuoted(session.camera_files[static_cast<size_t>(i)]));
    }
    absl::StrAppend(&text, "}\n");
  }
  if (!session.calibration.fundamental_matrices().empty()) {
    absl::StrAppend(&text, "pairs:",
                    session.camera_files.empty() ? "" : "  # for information; undistorted pixels",
                    "\n", MatrixFileText(session.calibration, cell));
  }
  absl::StrAppend(&text, FiguresText(record));
  if (!record.warnings().empty()) absl::StrAppend(&text, "warnings:\n");
  for (const std::string& warning : record.warnings()) {
    absl::StrAppend(&text, "  - ", YamlQuoted(warning), "\n");
  }
  return absl::StrCat(text, TagsText(record, cell));
}

bool IsSessionFile(const std::string& text) {
  try {
    return YAML::Load(text).IsMap();
  } catch (const YAML::Exception&) {
    return false;
  }
}

absl::StatusOr<CalibrationSession> SessionFromText(const std::string& text, const std::string& file,
                                                   const CellDescription& cell) {
  try {
    return ReadSession(YamlNode::FromText(text, file), cell);
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

}  // namespace silhouette
