// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "tools/silhouette-experiments/paper/voxel_hull.h"

namespace silhouette::paper {
namespace {

using Json = nlohmann::ordered_json;

auto GroupOf(const Row& row) { return std::tie(row.experiment, row.variant, row.rig, row.raster); }

auto LineOf(const Row& row) { return std::tie(row.method, row.voxels, row.threshold); }

double PercentOf(const Row& row, const Spread& spread) {
  return Percent(spread.mean(), row.configurations);
}

// "<name>_percent", "<name>_min_percent", ... "<name>_count", ...
void AddSpread(Json& object, const std::string& name, const Row& row, const Spread& spread) {
  object[name + "_percent"] = PercentOf(row, spread);
  object[name + "_min_percent"] = Percent(spread.least, row.configurations);
  object[name + "_max_percent"] = Percent(spread.greatest, row.configurations);
  object[name + "_count"] = spread.mean();
  object[name + "_min_count"] = spread.least;
  object[name + "_max_count"] = spread.greatest;
}

std::string NameWithVoxels(const std::string& method, int voxels) {
  return voxels == 0 ? method : absl::StrCat(method, ", ", voxels, " voxels");
}

// The table of rows of one experiment, variant, rig and raster.
std::string TextOfTable(std::span<const Row> rows, int views) {
  Table table{{"method", "min_views", "scenes"}};
  for (int n = 1; n <= views; ++n) {
    table.headings.push_back(absl::StrCat(n, n == 1 ? " camera" : " cameras"));
  }
  const bool timed =
      std::any_of(rows.begin(), rows.end(), [](const Row& row) { return row.times.has_value(); });
  if (timed) table.headings.insert(table.headings.end(), {"per scene", "all", "one"});
  const Row* last = nullptr;
  for (const Row& row : rows) {
    if (last == nullptr || LineOf(*last) != LineOf(row)) {
      table.rows.push_back({NameWithVoxels(row.method, row.voxels), NameOf(row.threshold),
                            absl::StrCat(row.scenes)});
      table.rows.back().resize(table.headings.size(), TableCell(""));
    }
    std::vector<TableCell>& line = table.rows.back();
    line[2 + static_cast<size_t>(row.views)] =
        absl::StrFormat("%.3f/%.4f", PercentOf(row, row.additional), PercentOf(row, row.missing));
    if (row.times) {
      line[line.size() - 3] = absl::StrFormat("%.2f ms", 1e3 * row.times->prepare_seconds);
      line[line.size() - 2] = absl::StrFormat("%.2f ms", 1e3 * row.times->space_seconds);
      line[line.size() - 1] = absl::StrFormat("%.2f us", 1e6 * row.times->check_seconds);
    }
    last = &row;
  }
  const Row& row = rows[0];
  return absl::StrFormat("%s, %s, rig %s, %s: %.2f %% really occupied\n%s\n", row.experiment,
                         NameOf(row.variant), row.rig, NameOf(row.raster),
                         PercentOf(row, row.occupied), silhouette::TextOf(table));
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

Mean MeanOf(std::span<const Row> rows, const std::string& method, int voxels) {
  Mean mean;
  for (const Row& row : rows) {
    if (row.experiment != "reconstruction" || row.method != method || row.voxels != voxels) {
      continue;
    }
    if (!row.times) continue;
    ++mean.groups;
    mean.occupied += PercentOf(row, row.occupied);
    mean.additional += PercentOf(row, row.additional);
    mean.missing += PercentOf(row, row.missing);
    mean.prepare_ms += 1e3 * row.times->prepare_seconds;
    mean.check_us += 1e6 * row.times->check_seconds;
  }
  for (double* sum :
       {&mean.occupied, &mean.additional, &mean.missing, &mean.prepare_ms, &mean.check_us}) {
    *sum /= std::max(mean.groups, 1);
  }
  return mean;
}

int FinestVoxels(std::span<const Row> rows) {
  int voxels = 0;
  for (const Row& row : rows) voxels = std::max(voxels, row.voxels);
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
std::string Compared(std::span<const Row> rows, Preset preset, RobotOut out) {
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

std::string TextOf(std::span<const Row> rows) {
  if (rows.empty()) return "";
  int views = 0;
  int64_t compared = 0;
  int64_t disagreements = 0;
  for (const Row& row : rows) {
    views = std::max(views, row.views);
    if (row.times && row.voxels == 0) compared += row.scenes * row.configurations;
    disagreements += row.disagreements;
  }
  std::string text;
  for (std::span<const Row> rest = rows; !rest.empty();) {
    const auto end = std::find_if(rest.begin(), rest.end(),
                                  [&](const Row& row) { return GroupOf(row) != GroupOf(rest[0]); });
    const auto count = static_cast<size_t>(end - rest.begin());
    text += TextOfTable(rest.first(count), views);
    rest = rest.subspan(count);
  }
  text +=
      "additional / missing configurations in percent of the configuration space: means over all\n"
      "sets of that number of cameras and over the scenes\n";
  if (compared == 0) return text;
  return absl::StrCat(
      text,
      "Processor time with all cameras: once per scene, all configurations, one configuration "
      "asked alone\n",
      absl::StrFormat("%d verdicts of the collision checker compared with those on all "
                      "configurations at once: %d differ\n\n",
                      compared, disagreements),
      ConclusionOf(rows));
}

std::string ConclusionOf(std::span<const Row> rows) {
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

Json JsonOf(std::span<const Row> rows) {
  Json array = Json::array();
  for (const Row& row : rows) {
    Json object = {{"experiment", row.experiment},
                   {"variant", NameOf(row.variant)},
                   {"rig", row.rig},
                   {"raster", NameOf(row.raster)},
                   {"preset", row.method},
                   {"min_views", NameOf(row.threshold)},
                   {"views", row.views},
                   {"camera_sets", row.camera_sets},
                   {"scenes", row.scenes},
                   {"configurations", row.configurations},
                   {"occupied_percent", PercentOf(row, row.occupied)}};
    AddSpread(object, "additional", row, row.additional);
    AddSpread(object, "missing", row, row.missing);
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

}  // namespace silhouette::paper
