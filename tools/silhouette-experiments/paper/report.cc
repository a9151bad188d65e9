// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/report.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"
#include "tools/silhouette-experiments/paper/voxel_hull.h"

namespace silhouette::paper {
namespace {

using nlohmann::ordered_json;

auto ReportBlockOf(const Row& row) {
  return std::tie(row.experiment, row.variant, row.rig, row.raster);
}

std::string HeadOf(const Row& row) {
  return absl::StrFormat("%s, %s, rig %s, %s: %.2f %% really occupied\n", NameOf(row.experiment),
                         NameOf(row.variant), row.rig, NameOf(row.raster),
                         Percent(row.occupied, row.configurations));
}

std::string ColumnsOf(int views) {
  std::string line = absl::StrFormat("  %-17s %-9s %7s", "preset", "min_views", "scenes");
  for (int n = 1; n <= views; ++n) {
    absl::StrAppendFormat(&line, "  %15s", absl::StrFormat("%d camera%s", n, n == 1 ? "" : "s"));
  }
  return line + "\n";
}

// "<name>_percent", "<name>_min_percent", ... "<name>_count", ...
void AddSpread(ordered_json& object, const std::string& name, const Spread& spread,
               int64_t configurations) {
  object[name + "_percent"] = Percent(spread.mean, configurations);
  object[name + "_min_percent"] = Percent(spread.least, configurations);
  object[name + "_max_percent"] = Percent(spread.greatest, configurations);
  object[name + "_count"] = spread.mean;
  object[name + "_min_count"] = spread.least;
  object[name + "_max_count"] = spread.greatest;
}

ordered_json JsonOf(const Counts& row, const std::string& experiment, Raster raster,
                    const std::string& preset, Threshold threshold) {
  ordered_json object = {{"experiment", experiment},
                         {"variant", NameOf(row.variant)},
                         {"rig", row.rig},
                         {"raster", NameOf(raster)},
                         {"preset", preset},
                         {"min_views", NameOf(threshold)},
                         {"views", row.views},
                         {"camera_sets", row.camera_sets},
                         {"scenes", row.scenes},
                         {"configurations", row.configurations},
                         {"occupied_percent", Percent(row.occupied, row.configurations)}};
  AddSpread(object, "additional", row.additional, row.configurations);
  AddSpread(object, "missing", row.missing, row.configurations);
  return object;
}

auto ReconstructionReportBlockOf(const MethodRow& row) {
  return std::tie(row.experiment, row.variant, row.rig);
}
auto LineOf(const MethodRow& row) {
  return std::tie(row.experiment, row.variant, row.rig, row.method, row.voxels);
}

std::string NameWithVoxels(const std::string& method, int voxels) {
  return voxels == 0 ? method : absl::StrCat(method, ", ", voxels, " voxels");
}

// One method with all cameras in the random scenes: means over robots and rigs.
struct Mean {
  int groups = 0;
  double occupied = 0;  // percent, as the following
  double additional = 0;
  double missing = 0;
  double prepare_ms = 0;
  double check_us = 0;
};

Mean MeanOf(std::span<const MethodRow> rows, const std::string& method, int voxels) {
  Mean mean;
  for (const MethodRow& row : rows) {
    if (row.experiment != "reconstruction" || row.method != method || row.voxels != voxels) {
      continue;
    }
    if (!row.times) continue;
    ++mean.groups;
    mean.occupied += Percent(row.occupied, row.configurations);
    mean.additional += Percent(row.additional.mean, row.configurations);
    mean.missing += Percent(row.missing.mean, row.configurations);
    mean.prepare_ms += 1e3 * row.times->prepare_seconds;
    mean.check_us += 1e6 * row.times->check_seconds;
  }
  for (double* sum :
       {&mean.occupied, &mean.additional, &mean.missing, &mean.prepare_ms, &mean.check_us}) {
    *sum /= std::max(mean.groups, 1);
  }
  return mean;
}

int FinestVoxels(std::span<const MethodRow> rows) {
  int voxels = 0;
  for (const MethodRow& row : rows) voxels = std::max(voxels, row.voxels);
  return voxels;
}

std::string Difference(double more) {
  if (std::abs(more) < 0.0005) return "as many";
  return absl::StrFormat("%.3f points %s", std::abs(more), more > 0 ? "more" : "fewer");
}

std::string Times(double ratio) {
  return ratio >= 10 ? absl::StrFormat("%.0f times", ratio) : absl::StrFormat("%.2g times", ratio);
}

// Up to how many configurations of a scene the images are the faster way.
std::string FasterWay(const Mean& images, const Mean& hull) {
  const double ahead = hull.prepare_ms - images.prepare_ms;
  const double gain = images.check_us - hull.check_us;
  if (ahead >= 0 && gain <= 0) return "the images are faster, however many are asked";
  if (ahead < 0 && gain >= 0) return "the hull is faster, however many are asked";
  return absl::StrFormat("the %s faster for up to %.0f configurations per scene",
                         ahead >= 0 ? "images are" : "hull is", 1e3 * ahead / gain);
}

// An image-based test beside the reconstruction that knows as much, at the finest voxels.
std::string Compared(std::span<const MethodRow> rows, Preset preset, RobotOut out) {
  const int voxels = FinestVoxels(rows);
  const Mean images = MeanOf(rows, NameOf(preset), 0);
  const Mean hull = MeanOf(rows, NameOf(out), voxels);
  if (images.groups == 0 || hull.groups == 0) return "";
  return absl::StrFormat(
      "- %s in place of %s: %s additional, %s missing configurations; %s the time per scene, %s "
      "per configuration: %s.\n",
      NameWithVoxels(NameOf(out), voxels), NameOf(preset),
      Difference(hull.additional - images.additional), Difference(hull.missing - images.missing),
      Times(hull.prepare_ms / images.prepare_ms), Times(hull.check_us / images.check_us),
      FasterWay(images, hull));
}

}  // namespace

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
    absl::StrAppendFormat(&table, "  %7.3f/%7.4f", Percent(row.additional.mean, row.configurations),
                          Percent(row.missing.mean, row.configurations));
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
    array.push_back(
        JsonOf(row, NameOf(row.experiment), row.raster, NameOf(row.preset), row.threshold));
  }
  return array;
}

std::string TableOf(std::span<const MethodRow> rows) {
  int views = 0;
  for (const MethodRow& row : rows) views = std::max(views, row.views);
  std::string table;
  const MethodRow* last = nullptr;
  int64_t compared = 0;
  int64_t disagreements = 0;
  for (const MethodRow& row : rows) {
    if (last == nullptr || ReconstructionReportBlockOf(*last) != ReconstructionReportBlockOf(row)) {
      absl::StrAppendFormat(
          &table, "%s%s, %s, rig %s, touch: %.2f %% really occupied, %d scene%s\n",
          last == nullptr ? "" : "\n", row.experiment, NameOf(row.variant), row.rig,
          Percent(row.occupied, row.configurations), row.scenes, row.scenes == 1 ? "" : "s");
      absl::StrAppendFormat(&table, "  %-33s", "method");
      for (int n = 1; n <= views; ++n) {
        absl::StrAppendFormat(&table, "  %15s",
                              absl::StrFormat("%d camera%s", n, n > 1 ? "s" : ""));
      }
      absl::StrAppendFormat(&table, " %10s %10s %10s\n", "scene", "all", "one");
    }
    if (last == nullptr || LineOf(*last) != LineOf(row)) {
      absl::StrAppendFormat(&table, "  %-33s", NameWithVoxels(row.method, row.voxels));
    }
    absl::StrAppendFormat(&table, "  %7.3f/%7.4f", Percent(row.additional.mean, row.configurations),
                          Percent(row.missing.mean, row.configurations));
    if (row.times) {
      absl::StrAppendFormat(&table, " %7.2f ms %7.2f ms %7.2f us\n",
                            1e3 * row.times->prepare_seconds, 1e3 * row.times->space_seconds,
                            1e6 * row.times->check_seconds);
      if (row.voxels == 0) {
        compared += row.scenes * row.configurations;
        disagreements += row.disagreements;
      }
    }
    last = &row;
  }
  if (last == nullptr) return table;
  return absl::StrCat(
      table,
      "\nadditional / missing configurations in percent; min_views n. Processor time with all "
      "cameras:\nonce per scene, all configurations, one configuration asked alone.\n",
      absl::StrFormat("%d verdicts of the collision test compared with those on all configurations "
                      "at once: %d differ\n\n",
                      compared, disagreements),
      ConclusionOf(rows));
}

std::string ConclusionOf(std::span<const MethodRow> rows) {
  const int voxels = FinestVoxels(rows);
  const Mean naive = MeanOf(rows, NameOf(RobotOut::kBody), voxels);
  std::string text;
  if (naive.groups == 0) return text;
  const double free = 100 - naive.occupied;
  absl::StrAppendFormat(
      &text,
      "Reconstruction against the images themselves, random scenes, all cameras:\n"
      "- %s: what is left around the robot blocks %.1f %% of the free configurations.\n",
      NameWithVoxels(NameOf(RobotOut::kBody), voxels), 100 * naive.additional / free);
  absl::StrAppend(&text, Compared(rows, Preset::kPaper, RobotOut::kPixels),
                  Compared(rows, Preset::kCalibrated, RobotOut::kHull));
  return text;
}

ordered_json JsonOf(std::span<const MethodRow> rows) {
  ordered_json array = ordered_json::array();
  for (const MethodRow& row : rows) {
    ordered_json object = JsonOf(row, row.experiment, Raster::kTouch, row.method, Threshold::kAll);
    if (row.voxels != 0) object["voxels"] = row.voxels;
    if (row.times) {
      object["prepare_ms"] = 1e3 * row.times->prepare_seconds;
      object["space_ms"] = 1e3 * row.times->space_seconds;
      object["check_us"] = 1e6 * row.times->check_seconds;
      if (row.voxels == 0) object["disagreements"] = row.disagreements;
    }
    array.push_back(std::move(object));
  }
  return array;
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
