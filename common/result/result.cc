// SPDX-License-Identifier: Apache-2.0
#include "common/result/result.h"

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace silhouette {

using Json = nlohmann::ordered_json;

namespace {

std::string PlainText(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

}  // namespace

std::string Counted(uint64_t count, const std::string& thing) {
  return absl::StrCat(count, " ", thing, count == 1 ? "" : "s");
}

TableCell TableCell::Unknown() {
  TableCell cell("-");
  cell.known = false;
  return cell;
}

std::string TextOf(const Table& table) {
  std::vector<std::vector<std::string>> rows;
  if (!table.headings.empty()) rows.push_back(table.headings);
  for (const std::vector<TableCell>& row : table.rows) {
    rows.emplace_back();
    for (const TableCell& cell : row) {
      rows.back().push_back(cell.small.empty() ? cell.text
                                               : absl::StrCat(cell.text, " ", cell.small));
    }
  }
  std::vector<size_t> widths;
  for (const std::vector<std::string>& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
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

Table TableOf(const Json& objects, const std::vector<Column>& columns) {
  Table table;
  for (const Column& column : columns) table.headings.push_back(column.heading);
  for (const Json& object : objects) {
    std::vector<TableCell>& row = table.rows.emplace_back();
    for (const Column& column : columns) {
      const auto value = object.find(column.key);
      if (value == object.end() || value->is_null()) {
        row.push_back(TableCell::Unknown());
      } else if (value->is_number() && column.decimals >= 0) {
        row.emplace_back(
            absl::StrFormat("%.*f%s", column.decimals, value->get<double>(), column.unit));
      } else {
        row.emplace_back(PlainText(*value));
      }
    }
  }
  return table;
}

std::string CsvOf(const Json& objects, std::vector<std::string> keys) {
  for (const Json& object : objects) {
    for (const auto& [key, value] : object.items()) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) keys.push_back(key);
    }
  }
  if (keys.empty()) return "";
  std::string csv = absl::StrJoin(keys, ",") + "\n";
  for (const Json& object : objects) {
    std::vector<std::string> fields;
    for (const std::string& key : keys) {
      const auto value = object.find(key);
      std::string field = value == object.end() || value->is_null() ? "" : PlainText(*value);
      if (field.find_first_of(",\"\n") != std::string::npos) {
        field = absl::StrCat("\"", absl::StrReplaceAll(field, {{"\"", "\"\""}}), "\"");
      }
      fields.push_back(std::move(field));
    }
    absl::StrAppend(&csv, absl::StrJoin(fields, ","), "\n");
  }
  return csv;
}

void PrintResult(const std::string& format, const Json& json, const std::string& text) {
  if (format == "json") {
    std::cout << json.dump(2) << '\n';
  } else {
    std::cout << text;
  }
}

}  // namespace silhouette
