// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/exchange.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <stdexcept>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/boards/csv.h"
#include "capture/segmentation/reference.h"
#include "common/picture/files.h"
#include "common/picture/image_file.h"
#include "common/picture/mask_png.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "tools/program/joint_values.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using storage::v1::CellDescription;

constexpr char kCapturedColumn[] = "captured";
constexpr char kCommanded[] = "commanded:";
constexpr char kMeasured[] = "measured:";

// How far from a grid value a stated one may be, radians or metres: files have six decimals.
constexpr double kRounding = 1e-6;

constexpr char kReferencesHeader[] = "view,images,time,mean,noise";

absl::Time ReferenceTime(const storage::v1::Reference& reference) {
  return absl::FromUnixSeconds(reference.time().seconds()) +
         absl::Nanoseconds(reference.time().nanos());
}

// InvalidArgument unless `text` is a time as RFC 3339 writes it.
absl::StatusOr<absl::Time> ParseTime(const std::string& column, const std::string& text) {
  absl::Time time;
  std::string why;
  if (absl::ParseTime(absl::RFC3339_full, text, &time, &why)) return time;
  return absl::InvalidArgumentError(
      absl::StrCat(column, " '", text, "' is not a time such as 2024-05-01T12:00:00Z"));
}

absl::StatusOr<std::string> ReadImageFile(const std::string& path) {
  RETURN_IF_ERROR(RefusePipe(path));
  ASSIGN_OR_RETURN(std::string bytes, ReadWholeFile(path));
  if (!ImageOfBytes(bytes, cv::IMREAD_UNCHANGED).empty()) return bytes;
  return InvalidArgument("'", path, "' is not an image, or is damaged");
}

absl::StatusOr<storage::v1::Reference> ReadReference(const std::string& folder, const CsvRow& row,
                                                     const storage::v1::View& view) {
  storage::v1::Reference reference;
  if (const std::string& text = row.Text(2); !text.empty()) {
    ASSIGN_OR_RETURN(const absl::Time time, ParseTime("time", text));
    const int64_t nanoseconds = absl::ToUnixNanos(time);
    reference.mutable_time()->set_seconds(nanoseconds / 1'000'000'000);
    reference.mutable_time()->set_nanos(static_cast<int32_t>(nanoseconds % 1'000'000'000));
  }
  ASSIGN_OR_RETURN(*reference.mutable_mean_png(), ReadImageFile(fs::path(folder) / row.Text(3)));
  ASSIGN_OR_RETURN(*reference.mutable_noise_png(), ReadImageFile(fs::path(folder) / row.Text(4)));
  ASSIGN_OR_RETURN(const Reference usable,
                   Reference::FromPng(reference.mean_png(), reference.noise_png()));
  const cv::Size size(view.image_width(), view.image_height());
  if (size.empty() || usable.size() == size) return reference;
  return InvalidArgument("the reference image of the view '", view.name(), "' is ",
                         usable.size().width, "x", usable.size().height,
                         " pixels large and should be ", size.width, "x", size.height);
}

}  // namespace

std::string CsvLine(const std::vector<std::string>& cells) {
  return absl::StrJoin(cells, ",", [](std::string* line, const std::string& cell) {
    absl::StrAppend(line, CsvField(cell));
  });
}

std::vector<std::string> AllJoints(const CellDescription& cell) {
  std::vector<std::string> names;
  for (const auto& joint : cell.grid_joints()) names.push_back(joint.name());
  for (const auto& joint : cell.fixed_joints()) names.push_back(joint.name());
  return names;
}

absl::StatusOr<std::vector<std::string>> ColumnsOf(const CellDescription& cell) {
  std::vector<std::string> columns;
  for (const auto& joint : cell.grid_joints()) columns.push_back(joint.name());
  for (const auto& view : cell.views()) columns.push_back(view.name());
  columns.emplace_back(kCapturedColumn);
  for (const char* prefix : {kCommanded, kMeasured}) {
    for (const std::string& joint : AllJoints(cell)) columns.push_back(prefix + joint);
  }
  std::set<std::string> names;
  for (const std::string& column : columns) {
    if (names.insert(column).second) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("a joint or view is named '", column,
                     "' as another column of the table is; such a cell has no table"));
  }
  return columns;
}

std::string PathPart(const std::string& name) {
  std::string part;
  for (char c : name) {
    if (absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_') {
      part += c;
    } else {
      absl::StrAppendFormat(&part, "%%%02x", static_cast<unsigned char>(c));
    }
  }
  return part;
}

TableReader::TableReader(std::string folder, const Cell& cell, ConfigurationGrid grid,
                         std::vector<MaskSize> mask_sizes)
    : folder_(std::move(folder)),
      cell_(DescriptionOf(cell)),
      joint_slides_(cell.joint_slides),
      joint_tolerance_(cell.capture.joint_tolerance),
      grid_(std::move(grid)),
      mask_sizes_(std::move(mask_sizes)) {}

absl::StatusOr<TableReader> TableReader::FromHeader(const std::string& csv,
                                                    absl::string_view header, const Cell& cell) {
  const CellDescription description = DescriptionOf(cell);
  ASSIGN_OR_RETURN(ConfigurationGrid grid, GridOf(description));
  ASSIGN_OR_RETURN(std::vector<MaskSize> mask_sizes, MaskSizesOf(description));
  ASSIGN_OR_RETURN(const std::vector<std::string> known, ColumnsOf(description));
  TableReader reader(fs::path(csv).parent_path().string(), cell, std::move(grid),
                     std::move(mask_sizes));
  const auto fault = [&](auto... parts) {
    return absl::InvalidArgumentError(absl::StrCat(csv, ":1: ", parts...));
  };
  const absl::StatusOr<std::vector<std::string>> cells = CsvFields(header);
  if (!cells.ok()) return fault(cells.status().message());
  for (size_t i = 0; i < cells->size(); ++i) {
    const std::string& name = (*cells)[i];
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      return fault("column '", name, "' is neither a joint nor a view of cell '", cell.name,
                   "'; write its columns with commas between them: ", absl::StrJoin(known, ","));
    }
    if (!reader.columns_.emplace(name, i).second)
      return fault("column '", name, "' is there twice");
  }
  const size_t needed =
      static_cast<size_t>(description.grid_joints_size() + description.views_size());
  for (size_t i = 0; i < known.size(); ++i) {
    const std::string& name = known[i];
    if (reader.columns_.contains(name)) continue;
    if (i < needed) return fault("column '", name, "' is missing");
    for (const char* prefix : {kCommanded, kMeasured}) {
      const bool wanted =
          name.starts_with(prefix) &&
          std::any_of(reader.columns_.begin(), reader.columns_.end(),
                      [&](const auto& column) { return column.first.starts_with(prefix); });
      if (wanted)
        return fault("column '", name, "' is missing; it is there for all joints or for none");
    }
  }
  return reader;
}

absl::StatusOr<RobotImage> TableReader::Read(absl::string_view line) const {
  ASSIGN_OR_RETURN(const std::vector<std::string> cells, CsvFields(line));
  if (cells.size() != columns_.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("it has ", cells.size(), " cells, the header has ", columns_.size()));
  }
  RobotImage image;
  ASSIGN_OR_RETURN(image.number, ReadNumber(cells));
  RETURN_IF_ERROR(ReadMasks(cells, image));
  if (const auto column = columns_.find(kCapturedColumn); column != columns_.end()) {
    const std::string& text = cells[column->second];
    if (!text.empty()) {
      ASSIGN_OR_RETURN(image.captured, ParseTime(kCapturedColumn, text));
    }
  }
  ASSIGN_OR_RETURN(image.commanded, ReadJoints(cells, kCommanded));
  ASSIGN_OR_RETURN(image.measured, ReadJoints(cells, kMeasured));
  RETURN_IF_ERROR(RequireMeasuredAt(image));
  return image;
}

absl::Status TableReader::RequireMeasuredAt(const RobotImage& image) const {
  if (image.measured.empty()) return absl::OkStatus();
  const Configuration stated = grid_.At(image.number);
  for (size_t j = 0; j < stated.size(); ++j) {
    const GridJoint& joint = grid_.joints()[j];
    if (joint.any()) continue;
    double off = image.measured[j] - stated[j];
    if (joint.continuous) off = std::remainder(off, 2 * std::numbers::pi);
    if (std::abs(off) <= joint_tolerance_) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "joint '%s' was measured at %g, not at %g: the masks show another configuration; if the "
        "robot stands no better, state a larger joint_tolerance in the cell file's section "
        "'capture'",
        joint.name, image.measured[j], stated[j]));
  }
  return absl::OkStatus();
}

absl::StatusOr<ConfigurationNumber> TableReader::ReadNumber(
    const std::vector<std::string>& cells) const {
  Configuration stated;
  std::vector<std::optional<bool>> slides;
  for (const GridJoint& joint : grid_.joints()) {
    const std::string& text = cells[columns_.at(joint.name)];
    ASSIGN_OR_RETURN(const double value, ReadJoint(joint.name, "joint '" + joint.name + "'", text));
    stated.push_back(value);
    const auto found = joint_slides_.find(joint.name);
    slides.push_back(found == joint_slides_.end() ? std::nullopt : std::optional(found->second));
  }
  GridIndex index{};
  for (int j = 0; j < grid_.dimensions(); ++j) {
    const auto at = static_cast<size_t>(j);
    const GridJoint& joint = grid_.joints()[at];
    const std::string& text = cells[columns_.at(joint.name)];
    const double inside = std::clamp(stated[at], joint.lower, joint.upper);
    const bool rounded = std::abs(inside - stated[at]) <= kRounding;
    const std::optional<double> place = grid_.Place(j, rounded ? inside : stated[at]);
    if (!place) {
      return absl::InvalidArgumentError(absl::StrCat(
          "joint '", joint.name, "': ", text, " is outside ", joint.lower, " to ", joint.upper,
          slides[at].value_or(false) ? " m" : DegreesHint(stated, "", slides)));
    }
    const double nearest = std::round(*place);
    if (std::abs(*place - nearest) * joint.step() > kRounding) {
      return absl::InvalidArgumentError(
          absl::StrFormat("joint '%s': %s is not on the grid; the nearest value is %.17g",
                          joint.name, text, joint.lower + nearest * joint.step()));
    }
    index[at] = static_cast<int>(nearest) % joint.steps;
  }
  return grid_.NumberOf(index);
}

absl::Status TableReader::ReadMasks(const std::vector<std::string>& cells,
                                    RobotImage& image) const {
  int empty = 0;
  for (const auto& view : cell_.views()) empty += cells[columns_.at(view.name())].empty() ? 1 : 0;
  image.excluded = empty == cell_.views_size();
  if (image.excluded) return absl::OkStatus();
  for (int i = 0; i < cell_.views_size(); ++i) {
    const std::string& view = cell_.views(i).name();
    const std::string& path = cells[columns_.at(view)];
    if (path.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "view '", view, "' has no mask; only an excluded configuration has none, in all views"));
    }
    const std::string file = fs::path(folder_) / path;
    const absl::Status is_file = RefusePipe(file);
    absl::StatusOr<Mask> mask = is_file.ok()
                                    ? ReadMaskPng(file, mask_sizes_[static_cast<size_t>(i)])
                                    : absl::StatusOr<Mask>(is_file);
    if (!mask.ok()) {
      return absl::Status(mask.status().code(),
                          absl::StrCat("view '", view, "': ", mask.status().message()));
    }
    image.masks.push_back(*std::move(mask));
  }
  if (ShowsNoRobot(image)) {
    return absl::InvalidArgumentError(
        "no mask has a pixel of the robot (white), so that no obstacle could ever meet it");
  }
  return absl::OkStatus();
}

absl::StatusOr<double> TableReader::ReadJoint(const std::string& joint, const std::string& called,
                                              const std::string& text) const {
  const auto slides = joint_slides_.find(joint);
  const bool known = slides != joint_slides_.end();
  try {
    return ParseJointValue(text, AngleUnit::kRadians,
                           known ? std::optional(slides->second) : std::nullopt);
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat(called, ": ", error.what()));
  }
}

absl::StatusOr<std::vector<double>> TableReader::ReadJoints(const std::vector<std::string>& cells,
                                                            const std::string& prefix) const {
  std::vector<double> values;
  std::vector<std::string> joints = AllJoints(cell_);
  if (!columns_.contains(prefix + joints.front())) return values;
  size_t empty = 0;
  for (const std::string& joint : joints) {
    const std::string& text = cells[columns_.at(prefix + joint)];
    empty += text.empty() ? 1 : 0;
    ASSIGN_OR_RETURN(const double value, text.empty() ? absl::StatusOr<double>(0)
                                                      : ReadJoint(joint, prefix + joint, text));
    values.push_back(value);
  }
  if (empty == joints.size()) return std::vector<double>();
  if (empty > 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(prefix, " is there for some joints and not for all"));
  }
  return values;
}

absl::Status ExportReferences(const std::string& folder, const storage::v1::CellDescription& cell,
                              const storage::v1::References& references) {
  RETURN_IF_ERROR(MakeFolder(absl::StrCat(folder, "/references")));
  std::string table = absl::StrCat(kReferencesHeader, "\n");
  for (int i = 0; i < references.views_size(); ++i) {
    const storage::v1::Reference& reference = references.views(i);
    const std::string& view = cell.views(i).name();
    const std::string stem = "references/" + PathPart(view);
    const std::string mean = stem + "-mean.png";
    const std::string noise = stem + "-noise.png";
    RETURN_IF_ERROR(WriteWholeFile(fs::path(folder) / mean, reference.mean_png()));
    RETURN_IF_ERROR(WriteWholeFile(fs::path(folder) / noise, reference.noise_png()));
    absl::StrAppend(&table,
                    CsvLine({view, absl::StrCat(reference.images()),
                             TimeText(ReferenceTime(reference)), mean, noise}),
                    "\n");
  }
  return WriteWholeFile(fs::path(folder) / kReferencesFile, table);
}

absl::StatusOr<std::optional<storage::v1::References>> ImportReferences(
    const std::string& folder, const storage::v1::CellDescription& cell) {
  const std::string path = (fs::path(folder) / kReferencesFile).string();
  RETURN_IF_ERROR(RefusePipe(path));
  const absl::StatusOr<std::string> table = ReadWholeFile(path);
  if (absl::IsNotFound(table.status())) return std::optional<storage::v1::References>();
  if (!table.ok()) return table.status();
  ASSIGN_OR_RETURN(const std::vector<CsvRow> rows,
                   CsvRows(*table, path, absl::StrSplit(kReferencesHeader, ',')));
  if (static_cast<int>(rows.size()) != cell.views_size()) {
    return InvalidArgument(path, ": it needs a row for each of the ", cell.views_size(),
                           " views, and has ", rows.size());
  }
  storage::v1::References references;
  for (const CsvRow& row : rows) {
    const storage::v1::View& view = cell.views(references.views_size());
    if (row.Text(0) != view.name()) {
      return InvalidArgument(row.place(), ": the view here is '", view.name(), "', not '",
                             row.Text(0), "': write the rows in the order of the cell file");
    }
    ASSIGN_OR_RETURN(const int images, row.Integer(1));
    absl::StatusOr<storage::v1::Reference> reference = ReadReference(folder, row, view);
    if (!reference.ok()) {
      return absl::Status(reference.status().code(),
                          absl::StrCat(row.place(), ": ", reference.status().message()));
    }
    reference->set_images(images);
    *references.add_views() = *std::move(reference);
  }
  return std::optional<storage::v1::References>(std::move(references));
}

}  // namespace silhouette
