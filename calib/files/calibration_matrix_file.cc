#include "calib/files/calibration_matrix_file.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/files/calibration_matrix_yaml.h"

namespace silhouette {
namespace {

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

std::string CalibrationMatrixQuoted(const std::string& name) {
  YAML::Emitter text;
  text << YAML::DoubleQuoted << name;
  return text.c_str();
}

}  // namespace

int ViewByName(const YamlNode& node, const storage::v1::CellDescription& cell) {
  const std::string name = node.As<std::string>();
  std::vector<std::string> views;
  for (int i = 0; i < cell.views_size(); ++i) {
    if (cell.views(i).name() == name) return i;
    views.push_back(cell.views(i).name());
  }
  node.Fail(absl::StrCat("there is no view '", name, "'; the views are ", ListOfWords(views)));
}

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

std::string MatrixFileText(const storage::v1::Calibration& calibration,
                           const storage::v1::CellDescription& cell) {
  std::string text =
      "# x_b' F x_a = 0 for the images of one point; mask pixels, integers at pixel centres.\n";
  for (const storage::v1::FundamentalMatrix& matrix : calibration.fundamental_matrices()) {
    absl::StrAppend(
        &text, "- view_a: ", CalibrationMatrixQuoted(cell.views(matrix.view_a()).name()),
        "\n  view_b: ", CalibrationMatrixQuoted(cell.views(matrix.view_b()).name()), "\n  F:\n");
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
    return absl::InvalidArgumentError(error.what());
  }
}

}  // namespace silhouette
