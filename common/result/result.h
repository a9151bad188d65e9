// SPDX-License-Identifier: Apache-2.0
// One result for people and for programs: as text, as JSON, and in parts of a page (page.h).
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace silhouette {

// "1 place", "2 places": `thing` takes an s.
std::string Counted(uint64_t count, const std::string& thing);

// A cell of a table; text alone converts to one.
struct TableCell {
  TableCell(std::string cell_text) : text(std::move(cell_text)) {}  // NOLINT(*explicit*)
  TableCell(const char* cell_text) : text(cell_text) {}             // NOLINT(*explicit*)
  TableCell(std::string cell_text, std::string cell_grade, std::string cell_small = "")
      : text(std::move(cell_text)), grade(std::move(cell_grade)), small(std::move(cell_small)) {}
  // Its value is not known: a dash.
  static TableCell Unknown();

  std::string text;
  std::string grade{};  // good, fair, bad or unknown: a dot in this colour; empty: no dot
  std::string small{};  // follows the text in small letters
  bool bold = false;
  bool known = true;
};

struct Table {
  std::vector<std::string> headings;
  std::vector<std::vector<TableCell>> rows{};
  bool narrow = false;  // a page shows it no wider than its text
};

// The table's columns aligned, the first to the left, the others to the right; without dots. The
// rows alone if there are no headings.
std::string TextOf(const Table& table);

// The table as the template part {{>table.html}} takes it. Its headings are HTML.
nlohmann::ordered_json JsonOf(const Table& table);

// A column of a table of JSON objects.
struct Column {
  std::string heading;
  std::string key;    // of the objects
  int decimals = -1;  // of numbers; below 0: as few as give the same number
  std::string unit = "";
};

// A row for each object of the array; a dash where it lacks the key.
Table TableOf(const nlohmann::ordered_json& objects, const std::vector<Column>& columns);

// The same as comma-separated values under a header of `keys` and of all other keys that the
// objects have; empty where an object lacks the key, or its value is null. Without any key: an
// empty text.
std::string CsvOf(const nlohmann::ordered_json& objects, std::vector<std::string> keys = {});

// Prints what a program has found: `json` if `format` is json, else `text`.
void PrintResult(const std::string& format, const nlohmann::ordered_json& json,
                 const std::string& text);

}  // namespace silhouette
