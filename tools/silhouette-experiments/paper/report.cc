#include "tools/silhouette-experiments/paper/report.h"

#include <algorithm>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace silhouette::paper {
namespace {

using nlohmann::ordered_json;

auto ReportBlockOf(const Row& row) {
  return std::tie(row.experiment, row.variant, row.rig, row.raster);
}

std::string HeadOf(const Row& row) {
  return absl::StrFormat("%s, %s, rig %s, %s: %.2f %% really occupied\n", NameOf(row.experiment),
                         NameOf(row.variant), row.rig, NameOf(row.raster),
                         Percent(row, row.occupied));
}

std::string ColumnsOf(int views) {
  std::string line = absl::StrFormat("  %-17s %-9s %7s", "preset", "min_views", "scenes");
  for (int n = 1; n <= views; ++n) {
    absl::StrAppendFormat(&line, "  %15s", absl::StrFormat("%d camera%s", n, n == 1 ? "" : "s"));
  }
  return line + "\n";
}

}  // namespace

double Percent(const Row& row, double configurations) {
  return 100 * configurations / static_cast<double>(row.configurations);
}

std::string TableOf(std::span<const Row> rows) {
  int views = 0;
  for (const Row& row : rows) views = std::max(views, row.views);
  std::string table;
  const Row* last = nullptr;
  int column = 0;  // the number of cameras that the line has come to
  for (const Row& row : rows) {
    const bool new_block = last == nullptr || ReportBlockOf(*last) != ReportBlockOf(row);
    if (new_block) {
      absl::StrAppend(&table, last == nullptr ? "" : "\n\n", HeadOf(row), ColumnsOf(views));
    }
    if (new_block || last->preset != row.preset || last->threshold != row.threshold) {
      absl::StrAppendFormat(&table, "%s  %-17s %-9s %7d", new_block ? "" : "\n", NameOf(row.preset),
                            NameOf(row.threshold), row.scenes);
      column = 0;
    }
    for (++column; column < row.views; ++column) absl::StrAppendFormat(&table, "  %15s", "-");
    absl::StrAppendFormat(&table, "  %7.3f/%7.4f", Percent(row, row.additional.mean),
                          Percent(row, row.missing.mean));
    last = &row;
  }
  if (last == nullptr) return table;
  return table +
         "\n\nadditional / missing configurations in percent of the configuration space: means "
         "over all\nsets of so many cameras and over the scenes\n";
}

ordered_json JsonOf(std::span<const Row> rows) {
  ordered_json array = ordered_json::array();
  for (const Row& row : rows) {
    ordered_json object = {{"experiment", NameOf(row.experiment)},
                           {"variant", NameOf(row.variant)},
                           {"rig", row.rig},
                           {"raster", NameOf(row.raster)},
                           {"preset", NameOf(row.preset)},
                           {"min_views", NameOf(row.threshold)},
                           {"views", row.views},
                           {"camera_sets", row.camera_sets},
                           {"scenes", row.scenes},
                           {"configurations", row.configurations},
                           {"occupied_percent", Percent(row, row.occupied)}};
    AddSpread(object, "additional", row.additional, row.configurations);
    AddSpread(object, "missing", row.missing, row.configurations);
    array.push_back(std::move(object));
  }
  return array;
}

void AddSpread(ordered_json& object, const std::string& name, const Spread& spread,
               int64_t configurations) {
  const auto percent = [&](double count) {
    return 100 * count / static_cast<double>(configurations);
  };
  object[name + "_percent"] = percent(spread.mean);
  object[name + "_min_percent"] = percent(static_cast<double>(spread.least));
  object[name + "_max_percent"] = percent(static_cast<double>(spread.greatest));
  object[name + "_count"] = spread.mean;
  object[name + "_min_count"] = spread.least;
  object[name + "_max_count"] = spread.greatest;
}

std::string CsvOf(const ordered_json& rows) {
  std::vector<std::string> keys;
  for (const ordered_json& row : rows) {
    for (const auto& [key, value] : row.items()) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) keys.push_back(key);
    }
  }
  if (keys.empty()) return "";
  std::string csv = absl::StrJoin(keys, ",") + "\n";
  for (const ordered_json& row : rows) {
    std::vector<std::string> cells;
    for (const std::string& key : keys) {
      const auto value = row.find(key);
      const bool none = value == row.end() || value->is_null();
      cells.push_back(none ? "" : value->is_string() ? value->get<std::string>() : value->dump());
    }
    absl::StrAppend(&csv, absl::StrJoin(cells, ","), "\n");
  }
  return csv;
}

}  // namespace silhouette::paper
