// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_table.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr char kFrame[] = "frame";

using Lines = std::vector<std::string>;

bool IsNumber(const std::string& word) {
  double number = 0;
  return absl::SimpleAtod(word, &number);
}

Lines FieldsOf(absl::string_view text) {
  return absl::StrSplit(text, absl::ByAnyChar(" \t\r\n,;[](){}"), absl::SkipEmpty());
}

// YAML's mark of a list: before a bracket or a name, where it cannot be a sign.
bool ConsumeListMarks(absl::string_view& line) {
  absl::string_view rest = absl::StripLeadingAsciiWhitespace(line);
  bool marked = false;
  while (rest.size() > 1 && rest[0] == '-' &&
         absl::ascii_isspace(static_cast<unsigned char>(rest[1]))) {
    rest = absl::StripLeadingAsciiWhitespace(rest.substr(1));
    marked = true;
  }
  if (!marked || rest.empty()) return false;
  const char next = rest.front();
  if (next != '[' && next != '"' && !absl::ascii_isalpha(static_cast<unsigned char>(next))) {
    return false;
  }
  line = rest;
  return true;
}

// Takes the marks away if every line has one.
void ReadListMarks(Lines& lines) {
  Lines unmarked = lines;
  for (std::string& line : unmarked) {
    absl::string_view rest = absl::StripAsciiWhitespace(line);
    if (rest.empty()) continue;
    if (!ConsumeListMarks(rest)) return;
    line = std::string(rest);
  }
  lines = std::move(unmarked);
}

// Whether brackets hold fields; those within a name, as in "img (1)", do not.
bool HasBracketsOfFields(const std::string& line) {
  const Lines fields = absl::StrSplit(line, ',');
  return std::ranges::any_of(fields, [](absl::string_view field) {
    field = absl::StripLeadingAsciiWhitespace(field);
    const auto count = [field](absl::string_view marks) {
      return std::ranges::count_if(field, [marks](char c) { return absl::StrContains(marks, c); });
    };
    return field.find_first_of("[({") == 0 || count("[({") != count("])}");
  });
}

// Whether anything but commas alone separates the fields.
bool IsToBeSplit(const std::string& line) {
  return line.find(',') == std::string::npos || HasBracketsOfFields(line);
}

Lines WithoutComments(absl::string_view text) {
  absl::ConsumePrefix(&text, "\xEF\xBB\xBF");  // a byte-order mark
  Lines lines = absl::StrSplit(text, '\n');
  for (std::string& line : lines) {
    const absl::string_view begin = absl::StripLeadingAsciiWhitespace(line);
    for (const char* const mark : {"#", "%", "//"}) {
      if (absl::StartsWith(begin, mark)) {
        line.clear();
        break;
      }
    }
  }
  return lines;
}

// "0,25": a number with a comma for a point.
bool HasDecimalComma(absl::string_view field) {
  const std::vector<std::string> parts = absl::StrSplit(field, ',');
  return parts.size() == 2 && !parts[1].empty() &&
         std::ranges::all_of(parts[1].substr(0, 1), absl::ascii_isdigit) && IsNumber(parts[0]);
}

// Of the lines one after the other; with the commas of those whose fields something else separates.
void ReadDecimalCommas(Lines& lines) {
  size_t decimal = 0;
  for (const std::string& line : lines) {
    const std::vector<std::string> fields =
        absl::StrSplit(line, absl::ByAnyChar(" \t\r;"), absl::SkipEmpty());
    for (const std::string& field : fields) {
      if (field.find(',') == std::string::npos) continue;
      if (fields.size() < 4 || !HasDecimalComma(field)) return;
      ++decimal;
    }
  }
  if (decimal == 0) return;
  for (std::string& line : lines) absl::StrReplaceAll({{",", "."}}, &line);
}

bool IsLastOfMatrix(const std::string& line) {
  constexpr std::array<double, 4> kLast = {0, 0, 0, 1};
  return std::ranges::equal(FieldsOf(line), kLast, [](const std::string& field, double expected) {
    double number = 0;
    return absl::SimpleAtod(field, &number) && number == expected;
  });
}

// Matrices over several lines as one line each, where the first of theirs was.
void JoinMatrices(Lines& lines) {
  constexpr size_t kSide = 4;
  std::vector<size_t> rows;
  std::vector<size_t> titles;
  for (size_t i = 0; i < lines.size(); ++i) {
    const std::vector<std::string> fields = FieldsOf(lines[i]);
    if (fields.empty()) continue;
    const bool row = fields.size() == kSide && std::ranges::all_of(fields, IsNumber);
    if (!row && fields.size() != 1) return;
    (row ? rows : titles).push_back(i);
  }
  if (rows.size() < kSide - 1) return;
  bool whole = rows.size() % kSide == 0;
  for (size_t i = kSide - 1; i < rows.size(); i += kSide) {
    whole = whole && IsLastOfMatrix(lines[rows[i]]);
  }
  const size_t side = whole ? kSide : kSide - 1;
  if (rows.size() % side != 0) return;
  const bool named = titles.size() == rows.size() / side;
  Lines joined(lines.size());
  for (size_t i = 0; i < rows.size(); i += side) {
    std::string& line = joined[rows[i]];
    if (named) line = lines[titles[i / side]];
    for (size_t k = i; k < i + side; ++k) absl::StrAppend(&line, " ", lines[rows[k]]);
  }
  lines = std::move(joined);
}

// What the notation calls a column; the name itself if it is none of its own.
std::string ColumnOf(std::string name, const std::vector<std::string>& columns) {
  static const std::set<std::string> frames = {"frame", "image", "file", "filename",  "name",
                                               "id",    "index", "time", "timestamp", "stamp"};
  static const std::set<std::string> positions = {"", "t", "p", "pos", "position", "translation"};
  static const std::set<std::string> quaternions = {"q", "quat", "quaternion", "orientation",
                                                    "rot"};
  absl::AsciiStrToLower(&name);
  name = absl::StrReplaceAll(name, {{"\"", ""}});
  if (name.empty() || std::ranges::find(columns, name) != columns.end()) return name;
  if (frames.contains(name)) return kFrame;
  const std::string stem =
      absl::StrReplaceAll(name.substr(0, name.size() - 1), {{"_", ""}, {".", ""}});
  const size_t axis = std::string("xyzw").find(name.back());
  if (axis == std::string::npos) return name;
  if (axis < 3 && positions.contains(stem)) return columns[axis];
  if (!quaternions.contains(stem) || columns.size() != 7) return name;
  const bool real_first = columns[3] == "q1";
  return columns[3 + (real_first ? (axis + 1) % 4 : axis)];
}

Lines NumbersIn(absl::string_view text) {
  Lines fields = FieldsOf(text);
  std::erase_if(fields, [](const std::string& field) { return !IsNumber(field); });
  return fields;
}

// The numbers after the notation's names, as in {X 1, Y 2, ...}; empty if one is not there once.
Lines NamedNumbers(absl::string_view text, const Lines& columns) {
  const Lines words = absl::StrSplit(text, absl::ByAnyChar(" \t\r\n,;:={}"), absl::SkipEmpty());
  Lines numbers(columns.size());
  for (size_t i = 0; i + 1 < words.size(); ++i) {
    const auto column = std::ranges::find(columns, absl::AsciiStrToLower(words[i]));
    if (column == columns.end() || !IsNumber(words[i + 1])) continue;
    std::string& number = numbers[column - columns.begin()];
    // Twice, or with a decimal comma.
    if (!number.empty() || (i + 2 < words.size() && IsNumber(words[i + 2]))) return {};
    number = words[i + 1];
  }
  return std::ranges::count(numbers, "") == 0 ? numbers : Lines();
}

// Of RAPID's robtarget [[x, y, z], [q1, q2, q3, q4], [4 of the axes], [6 more]]; else empty.
Lines NumbersOfRobtarget(absl::string_view text) {
  std::vector<Lines> lists;
  for (const absl::string_view list : absl::StrSplit(text, ']')) {
    lists.push_back(NumbersIn(list));
    if (lists.back().empty()) lists.pop_back();
  }
  const std::array<size_t, 4> sizes = {3, 4, 4, 6};
  if (!std::ranges::equal(lists, sizes, std::equal_to(), &Lines::size)) return {};
  lists[0].insert(lists[0].end(), lists[1].begin(), lists[1].end());
  return lists[0];
}

bool IsCutOff(const std::string& record) {
  return std::ranges::count(record, '{') != std::ranges::count(record, '}') ||
         std::ranges::count(record, '[') != std::ranges::count(record, ']');
}

// A pose in a controller's own syntax, as a line of name and numbers; empty if it is none.
std::string LineOfRecord(const std::string& record, const PoseNotation& notation) {
  const size_t open = record.find('{') != std::string::npos ? record.find('{') : record.find('[');
  if (open == std::string::npos || IsCutOff(record)) return "";
  const absl::string_view inside = absl::string_view(record).substr(open);
  const absl::string_view before = absl::string_view(record).substr(0, open);
  Lines words = absl::StrSplit(before, absl::ByAnyChar(" \t\r\n,;:=[]\""), absl::SkipEmpty());
  Lines numbers;
  if (inside.front() == '{') {
    numbers = NamedNumbers(inside, notation.columns());
  } else if (notation.name() == "abb") {
    numbers = NumbersOfRobtarget(inside);
  } else if (notation.name() == "ur" && !words.empty() && words.back() == "p") {
    numbers = NumbersIn(inside);
    words.pop_back();
  }
  if (numbers.empty()) return "";
  if (!words.empty()) numbers.insert(numbers.begin(), words.back());
  return absl::StrJoin(numbers, ",");
}

}  // namespace

std::string WithoutRobotSyntax(const std::string& text, const PoseNotation& notation) {
  constexpr size_t kMostLines = 20;  // of a record
  Lines lines = WithoutComments(text);
  bool found = false;
  for (size_t i = 0; i < lines.size(); ++i) {
    std::string record = lines[i];
    size_t last = i;
    while (std::ranges::count(record, '{') > std::ranges::count(record, '}') &&
           last + 1 < lines.size() && last - i < kMostLines) {
      absl::StrAppend(&record, "\n", lines[++last]);
    }
    const std::string line = LineOfRecord(record, notation);
    if (line.empty()) {
      // Such as /POS and ENDDAT.
      if (NumbersIn(lines[i]).empty()) lines[i].clear();
      continue;
    }
    found = true;
    lines[i] = line;
    while (i < last) lines[++i].clear();
  }
  return found ? absl::StrJoin(lines, "\n") : text;
}

std::vector<std::string> PoseFields(const std::string& text) {
  Lines lines = absl::StrSplit(text, '\n');
  ReadListMarks(lines);
  const std::string joined = absl::StrJoin(lines, "\n");
  return FieldsOf(absl::StripPrefix(joined, "array("));
}

absl::StatusOr<PoseTable> PoseTableOf(const std::string& text, const std::string& file,
                                      const PoseNotation& notation) {
  PoseTable table;
  Lines lines = WithoutComments(text);
  ReadListMarks(lines);
  ReadDecimalCommas(lines);
  for (size_t i = 0; i < lines.size(); ++i) {
    const Lines fields = FieldsOf(lines[i]);
    if (!IsToBeSplit(lines[i]) || std::ranges::find(fields, "-") == fields.end()) continue;
    return InvalidArgument(file, ":", i + 1, ": a '-' stands apart; write it with its number");
  }
  const bool matrix = notation.name() == "matrix";
  if (matrix) JoinMatrices(lines);
  table.columns = notation.columns();
  bool first = true;
  for (std::string& line : lines) {
    std::vector<std::string> fields = FieldsOf(line);
    if (IsToBeSplit(line)) line = absl::StrJoin(fields, ",");
    if (fields.empty() || !first) continue;
    first = false;
    table.named = !IsNumber(fields.back());
    if (table.named) {
      for (std::string& name : fields) name = ColumnOf(name, notation.columns());
      line = absl::StrJoin(fields, ",");
      const bool known = std::ranges::find(fields, table.columns.front()) != fields.end();
      table.has_frames = !known || std::ranges::find(fields, kFrame) != fields.end();
    } else {
      if (matrix && (fields.size() == 12 || fields.size() == 13)) table.columns.resize(12);
      table.has_frames = fields.size() != table.columns.size();
    }
  }
  if (table.has_frames) table.columns.insert(table.columns.begin(), kFrame);
  table.csv = absl::StrJoin(lines, "\n");
  return table;
}

}  // namespace silhouette
