// SPDX-License-Identifier: Apache-2.0
// The folder that `export` writes and `import` reads:
//
//   configurations.csv   one row per record; comma separated, quoted as RFC 4180 says, a header
//     <joint>            per joint of the grid, by its name: radians or metres, or with a unit, as
//                        in 30deg
//     <view>             per view, by its name: path of a PNG mask, relative to the CSV; empty for
//                        all views: the configuration is excluded
//     captured           optional: UTC time as RFC 3339 writes it; empty: not known
//     commanded:<joint>  optional, for all joints of the cell or for none, fixed ones too; empty in
//     measured:<joint>   all of them: not known
//   masks/<view>/<tile>/<number>.png
//   references.csv       only if there are reference images: view, images, time, mean, noise (the
//                        last two are paths of 16-bit PNG files)
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

inline constexpr char kConfigurationsFile[] = "configurations.csv";
inline constexpr char kReferencesFile[] = "references.csv";

// A line of a CSV file, without its end.
std::string CsvLine(const std::vector<std::string>& cells);

// The names of all joints of a cell, in the order of RobotImage::measured.
std::vector<std::string> AllJoints(const storage::v1::CellDescription& cell);

// The columns that export writes. InvalidArgument if two would have one name.
absl::StatusOr<std::vector<std::string>> ColumnsOf(const storage::v1::CellDescription& cell);

// The name of a view or joint as part of a path.
std::string PathPart(const std::string& name);

// Reads the rows of a configurations.csv.
class TableReader {
 public:
  // `csv`: the file's path. InvalidArgument, naming the file, if a column is missing, unknown or
  // there twice.
  static absl::StatusOr<TableReader> FromHeader(const std::string& csv, absl::string_view header,
                                                const Cell& cell);

  // The record of a row, its masks read from their files. Everything is checked; the message does
  // not name the row.
  absl::StatusOr<RobotImage> Read(absl::string_view line) const;

 private:
  TableReader(std::string folder, const Cell& cell, ConfigurationGrid grid,
              std::vector<MaskSize> mask_sizes);

  absl::StatusOr<ConfigurationNumber> ReadNumber(const std::vector<std::string>& cells) const;
  absl::Status ReadMasks(const std::vector<std::string>& cells, RobotImage& image) const;
  // InvalidArgument if the robot was measured elsewhere than at the row's configuration.
  absl::Status RequireMeasuredAt(const RobotImage& image) const;
  // `called`: what a message calls the value.
  absl::StatusOr<double> ReadJoint(const std::string& joint, const std::string& called,
                                   const std::string& text) const;
  absl::StatusOr<std::vector<double>> ReadJoints(const std::vector<std::string>& cells,
                                                 const std::string& prefix) const;

  std::string folder_;
  storage::v1::CellDescription cell_;
  std::map<std::string, bool> joint_slides_;  // Cell::joint_slides
  double joint_tolerance_;                    // of the cell's capture
  ConfigurationGrid grid_;
  std::vector<MaskSize> mask_sizes_;
  std::map<std::string, size_t> columns_;  // by name
};

// Writes, and reads, references.csv and its files. Reading gives nothing if there is no such file,
// and fails unless every view has a mean and a noise that background subtraction can use.
// Reference::with_robot is not among what they state.
absl::Status ExportReferences(const std::string& folder, const storage::v1::CellDescription& cell,
                              const storage::v1::References& references);
absl::StatusOr<std::optional<storage::v1::References>> ImportReferences(
    const std::string& folder, const storage::v1::CellDescription& cell);

}  // namespace silhouette
