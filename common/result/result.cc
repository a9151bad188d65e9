// SPDX-License-Identifier: Apache-2.0
#include "common/result/result.h"

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"

namespace silhouette {

using Json = nlohmann::ordered_json;

TableCell TableCell::Unknown() {
  TableCell cell("-");
  cell.known = false;
  return cell;
}

std::string TextOf(const Table& table) {
  std::vector<std::vector<std::string>> rows = {table.headings};
  for (const std::vector<TableCell>& row : table.rows) {
    rows.emplace_back();
    for (const TableCell& cell : row) {
      rows.back().push_back(cell.small.empty() ? cell.text
                                               : absl::StrCat(cell.text, " ", cell.small));
    }
  }
  std::vector<size_t> widths(table.headings.size());
  for (const std::vector<std::string>& row : rows) {
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const std::vector<std::string>& row : rows) {
    for (size_t i = 0; i < row.size(); ++i) {
      const std::string space(widths[i] - row[i].size(), ' ');
      absl::StrAppend(&text, i == 0 ? "" : "  ", i == 0 ? row[i] + space : space + row[i]);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  return text;
}

Json JsonOf(const Table& table) {
  Json rows = Json::array();
  for (const std::vector<TableCell>& row : table.rows) {
    Json cells = Json::array();
    for (const TableCell& cell : row) {
      const auto given = [](const std::string& text) { return text.empty() ? Json() : Json(text); };
      cells.push_back({{"text", cell.known ? Json(cell.text) : Json()},
                       {"grade", given(cell.grade)},
                       {"small", given(cell.small)},
                       {"bold", cell.bold}});
    }
    rows.push_back({{"cells", cells}});
  }
  return {{"headings", table.headings}, {"rows", rows}, {"narrow", table.narrow}};
}

void PrintResult(const std::string& format, const Json& json, const std::string& text) {
  if (format == "json") {
    std::cout << json.dump(2) << '\n';
  } else {
    std::cout << text;
  }
}

}  // namespace silhouette
