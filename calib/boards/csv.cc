// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// What follows a byte-order mark.
absl::string_view WithoutMark(absl::string_view text) {
  absl::ConsumePrefix(&text, "\xEF\xBB\xBF");
  return text;
}

// For each wanted column its place in the header.
absl::StatusOr<std::vector<size_t>> Places(const std::vector<std::string>& header,
                                           const std::vector<std::string>& columns,
                                           const std::string& place) {
  if (header.size() == 1 && columns.size() > 1 && absl::StrContains(header[0], ';')) {
    return InvalidArgument(place,
                           ": ';' separates the columns; save the file with commas, and "
                           "numbers with a point");
  }
  std::vector<size_t> places(columns.size(), header.size());
  for (size_t i = 0; i < header.size(); ++i) {
    const std::string name(absl::StripAsciiWhitespace(header[i]));
    const size_t column = std::ranges::find(columns, name) - columns.begin();
    if (column == columns.size()) {
      const std::string near = NearestWord(name, columns);
      return InvalidArgument(place, ": unknown column '", name, "'",
                             near.empty() ? "" : absl::StrCat(", did you mean '", near, "'?"),
                             "; the first line is ", absl::StrJoin(columns, ","));
    }
    if (places[column] != header.size()) {
      return InvalidArgument(place, ": the column '", name, "' is there twice");
    }
    places[column] = i;
  }
  for (size_t column = 0; column < columns.size(); ++column) {
    if (places[column] == header.size()) {
      return InvalidArgument(place, ": the column '", columns[column],
                             "' is missing; the first line is ", absl::StrJoin(columns, ","));
    }
  }
  return places;
}

}  // namespace

absl::StatusOr<double> CsvRow::Number(size_t column) const {
  double value = 0;
  if (!absl::SimpleAtod(Text(column), &value) || !std::isfinite(value)) {
    return InvalidArgument(place_, ": '", Text(column), "' is not a finite number");
  }
  return value;
}

absl::StatusOr<int> CsvRow::Integer(size_t column) const {
  int value = 0;
  if (!absl::SimpleAtoi(Text(column), &value)) {
    return InvalidArgument(place_, ": '", Text(column), "' is not a whole number");
  }
  return value;
}

absl::StatusOr<std::vector<std::string>> CsvFields(absl::string_view line) {
  constexpr char kQuotes[] = "the double quotes do not match";
  absl::ConsumeSuffix(&line, "\r");
  std::vector<std::string> fields(1);
  bool quoted = false;
  bool closed = false;
  for (size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quoted) {
      if (c != '"') {
        fields.back() += c;
      } else if (i + 1 < line.size() && line[i + 1] == '"') {
        fields.back() += c;
        ++i;
      } else {
        quoted = false;
        closed = true;
      }
    } else if (c == ',') {
      fields.emplace_back();
      closed = false;
    } else if (c == '"' && absl::StripAsciiWhitespace(fields.back()).empty() && !closed) {
      fields.back().clear();
      quoted = true;
    } else if (!closed) {
      fields.back() += c;
    } else if (!absl::ascii_isspace(static_cast<unsigned char>(c))) {
      return InvalidArgument(kQuotes);
    }
  }
  if (quoted) return InvalidArgument(kQuotes);
  return fields;
}

absl::StatusOr<std::vector<CsvRow>> CsvRows(const std::string& text, const std::string& file,
                                            const std::vector<std::string>& columns,
                                            CsvHeader header) {
  std::vector<CsvRow> rows;
  std::optional<std::vector<size_t>> places;
  if (header == CsvHeader::kNone) {
    places.emplace(columns.size());
    std::iota(places->begin(), places->end(), 0);
  }
  int number = 0;
  for (const absl::string_view line : absl::StrSplit(WithoutMark(text), '\n')) {
    const std::string place = absl::StrCat(file, ":", ++number);
    if (absl::StripAsciiWhitespace(line).empty()) continue;
    absl::StatusOr<std::vector<std::string>> fields = CsvFields(line);
    if (!fields.ok()) return InvalidArgument(place, ": ", fields.status().message());
    if (!places) {
      if (header == CsvHeader::kAnyCase) {
        for (std::string& name : *fields) absl::AsciiStrToLower(&name);
      }
      ASSIGN_OR_RETURN(std::vector<size_t> found, Places(*fields, columns, place));
      places = std::move(found);
      continue;
    }
    if (fields->size() != columns.size()) {
      return InvalidArgument(place, ": ", fields->size(), " fields, ", columns.size(),
                             " are expected: ", absl::StrJoin(columns, ","));
    }
    std::vector<std::string> ordered;
    for (const size_t from : *places) ordered.push_back(std::move((*fields)[from]));
    rows.emplace_back(place, std::move(ordered));
  }
  if (!places) {
    return InvalidArgument(file, ": the file is empty; its first line is ",
                           absl::StrJoin(columns, ","));
  }
  return rows;
}

std::vector<std::string> CsvColumns(absl::string_view text) {
  for (const absl::string_view line : absl::StrSplit(WithoutMark(text), '\n')) {
    if (absl::StripAsciiWhitespace(line).empty()) continue;
    std::vector<std::string> names = CsvFields(line).value_or(std::vector<std::string>());
    for (std::string& name : names) absl::StripAsciiWhitespace(&name);
    return names;
  }
  return {};
}

std::string CsvField(absl::string_view text) {
  const bool spaced = absl::StripAsciiWhitespace(text).size() != text.size();
  if (!spaced && text.find_first_of(",\"\r\n") == absl::string_view::npos) return std::string(text);
  return absl::StrCat("\"", absl::StrReplaceAll(text, {{"\"", "\"\""}}), "\"");
}

std::string CsvNumber(double value) {
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof(digits), value).ptr};
}

}  // namespace silhouette
