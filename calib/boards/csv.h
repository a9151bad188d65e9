// SPDX-License-Identifier: Apache-2.0
// Tables as comma-separated values: a line of column names, then one line a row. A field may be in
// double quotes, a quote in it is doubled.
#pragma once

#include <string>

#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace silhouette {

// One row of a table that was read; it knows its place for messages.
class CsvRow {
 public:
  CsvRow(std::string place, std::vector<std::string> fields)
      : place_(std::move(place)), fields_(std::move(fields)) {}

  // "corners.csv:12"
  const std::string& place() const { return place_; }
  // In the order of the columns that were asked for.
  const std::string& Text(size_t column) const { return fields_[column]; }
  // The errors are InvalidArgument: no number, or not a finite one.
  absl::StatusOr<double> Number(size_t column) const;
  absl::StatusOr<int> Integer(size_t column) const;

 private:
  std::string place_;
  std::vector<std::string> fields_;
};

// What the first line of a table is: the columns' names, these in small letters or capitals, or a
// row as all others, whose columns are in the order that was asked for.
enum class CsvHeader { kExact, kAnyCase, kNone };

// The rows of a table that has exactly these columns, in any order. Empty lines are skipped.
// InvalidArgument with `file` and line: a column is missing, unknown or there twice, a row has more
// or fewer fields, a quote is open.
absl::StatusOr<std::vector<CsvRow>> CsvRows(const std::string& text, const std::string& file,
                                            const std::vector<std::string>& columns,
                                            CsvHeader header = CsvHeader::kExact);

// The names in the first line of such a table, for one whose columns are not known before; none if
// there is no such line, or a quote in it is open.
std::vector<std::string> CsvColumns(absl::string_view text);

// The fields of one line, which may end with a carriage return. InvalidArgument: a quote is open,
// or text follows a closed one.
absl::StatusOr<std::vector<std::string>> CsvFields(absl::string_view line);

// A field as it is written: in quotes if it needs them.
std::string CsvField(absl::string_view text);
// A number with as few digits as give the same number when they are read.
std::string CsvNumber(double value);

}  // namespace silhouette
