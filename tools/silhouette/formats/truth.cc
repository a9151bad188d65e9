// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/formats/truth.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Fields = std::vector<absl::string_view>;

absl::Status Mistake(const std::string& file, size_t line, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(file, ":", line, ": ", what));
}

Fields FieldsOf(absl::string_view line) {
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return absl::StrSplit(line, ',');
}

// Where the columns are.
struct Columns {
  size_t number = 0;
  size_t contact = 0;
  std::vector<size_t> joints;
  size_t count = 0;
};

absl::StatusOr<Columns> ColumnsOf(const std::string& file, const Fields& header,
                                  const ConfigurationGrid& grid) {
  absl::Status status;
  const auto column = [&](absl::string_view name) {
    const auto found = std::find(header.begin(), header.end(), name);
    if (found == header.end()) {
      status.Update(Mistake(file, 1, absl::StrCat("the column '", name, "' is missing")));
    }
    return static_cast<size_t>(found - header.begin());
  };
  Columns columns{.number = column("number"), .contact = column("contact"), .joints = {}};
  for (const GridJoint& joint : grid.joints()) columns.joints.push_back(column(joint.name));
  columns.count = header.size();
  if (!status.ok()) return status;
  return columns;
}

// Empty if the row belongs to a configuration of the grid.
std::string RowFault(const Fields& row, const Columns& columns, const ConfigurationGrid& grid,
                     ConfigurationNumber& number, bool& contact) {
  if (row.size() != columns.count) return absl::StrCat("has ", row.size(), " fields");
  if (!absl::SimpleAtoi(row[columns.number], &number)) return "the number is none";
  const absl::string_view flag = row[columns.contact];
  if (flag != "0" && flag != "1") return "contact is neither 0 nor 1";
  contact = flag == "1";
  if (!grid.Contains(number)) return absl::StrCat("the grid has no configuration ", number);
  const Configuration expected = grid.At(number);
  for (size_t j = 0; j < expected.size(); ++j) {
    double value = 0;
    if (!absl::SimpleAtod(row[columns.joints[j]], &value) || std::abs(value - expected[j]) > 1e-6) {
      return absl::StrCat("configuration ", number, " of the grid has ", grid.joints()[j].name,
                          " = ", expected[j], ": the truth is of another grid");
    }
  }
  return "";
}

}  // namespace

absl::StatusOr<Truth> Truth::Read(const std::string& file, const ConfigurationGrid& grid) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  const std::vector<absl::string_view> lines = absl::StrSplit(text, '\n');
  ASSIGN_OR_RETURN(const auto columns, ColumnsOf(file, FieldsOf(lines[0]), grid));
  Truth truth;
  for (size_t i = 1; i < lines.size(); ++i) {
    if (lines[i].empty()) continue;
    ConfigurationNumber number = 0;
    bool contact = false;
    const std::string fault = RowFault(FieldsOf(lines[i]), columns, grid, number, contact);
    if (!fault.empty()) return Mistake(file, i + 1, fault);
    if (!truth.contacts_.emplace(number, contact).second) {
      return Mistake(file, i + 1, absl::StrCat("configuration ", number, " comes twice"));
    }
  }
  if (truth.contacts_.size() != grid.size()) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": has ", truth.contacts_.size(), " of ",
                                                   grid.size(), " configurations of the grid"));
  }
  return truth;
}

Judgement Judge(const client::ConfigurationSpace& space, const Truth& truth) {
  Judgement judgement;
  const ConfigurationGrid& grid = space.grid();
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    const bool contact = truth.Contact(number);
    const client::State state = space.StateAt(number);
    ++judgement.configurations;
    judgement.occupied_in_truth += contact ? 1 : 0;
    judgement.missing += contact && state == client::State::kFree ? 1 : 0;
    judgement.additional += !contact && state == client::State::kOccupied ? 1 : 0;
    judgement.unknown += state == client::State::kUnknown ? 1 : 0;
  }
  return judgement;
}

}  // namespace silhouette
