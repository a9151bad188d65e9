// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "common/picture/chart.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"

namespace silhouette::people_experiment {
namespace {

// Episodes of a study are equally long.
std::optional<WorkRatio> WorkAgainst(std::span<const EpisodeResult> results,
                                     const std::string& method, const std::string& other) {
  std::map<int, std::array<std::optional<double>, 2>> cycles;  // by episode
  for (const EpisodeResult& result : results) {
    if (result.method == method) cycles[result.episode][0] = result.counts.cycles;
    if (result.method == other) cycles[result.episode][1] = result.counts.cycles;
  }
  std::erase_if(cycles, [](const auto& each) { return !each.second[0] || !each.second[1]; });
  double own = 0;
  double others = 0;
  for (const auto& [episode, both] : cycles) {
    own += *both[0];
    others += *both[1];
  }
  if (others == 0) return std::nullopt;
  WorkRatio work{.ratio = own / others, .standard_error = std::nullopt};
  if (cycles.size() < 2) return work;
  double squares = 0;
  for (const auto& [episode, both] : cycles) {
    const double residual = *both[0] - work.ratio * *both[1];
    squares += residual * residual;
  }
  const auto n = static_cast<double>(cycles.size());
  work.standard_error = std::sqrt(squares * n / (n - 1)) / others;
  return work;
}

// "0.82 +-0.05"; "-" of nothing.
std::string Ratio(const std::optional<WorkRatio>& work) {
  if (!work) return "-";
  return absl::StrFormat("%.2f", work->ratio) +
         (work->standard_error ? absl::StrFormat(" +-%.2f", *work->standard_error) : "");
}

void AddRatio(const char* key, const std::optional<WorkRatio>& work, nlohmann::ordered_json& row) {
  if (!work) return;
  row[key] = work->ratio;
  if (work->standard_error) row[absl::StrCat(key, "_standard_error")] = *work->standard_error;
}

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

}  // namespace

std::vector<MethodFigures> FiguresOf(std::span<const EpisodeResult> results,
                                     std::span<const std::string> methods) {
  std::vector<MethodFigures> figures;
  for (const std::string& method : methods) {
    MethodFigures& row = figures.emplace_back(
        MethodFigures{.name = method,
                      .counts = {},
                      .to_curtain = WorkAgainst(results, method, "light_curtain"),
                      .to_oracle = WorkAgainst(results, method, "oracle")});
    for (const EpisodeResult& result : results) {
      if (result.method == method) row.counts.Add(result.counts);
    }
  }
  return figures;
}

std::string TextOf(std::span<const MethodFigures> figures) {
  Table table{.headings = {"method", "cycles/h", "to curtain", "to oracle", "contacts, moving",
                           "contacts", "stops/h", "standing %", "too fast s/h", "leaving s/h",
                           "reaction s", "least over stopping m", "scenes", "unusable %",
                           "core s/episode"}};
  for (const auto& [name, counts, to_curtain, to_oracle] : figures) {
    const double hours = counts.seconds / 3600;
    table.rows.push_back({name, absl::StrFormat("%.0f", counts.CyclesPerHour()), Ratio(to_curtain),
                          Ratio(to_oracle), absl::StrCat(counts.contacts_moving),
                          absl::StrCat(counts.contacts),
                          absl::StrFormat("%.0f", counts.stops / hours),
                          absl::StrFormat("%.0f", Percent(counts.standing, counts.seconds)),
                          absl::StrFormat("%.1f", counts.too_fast / hours),
                          absl::StrFormat("%.1f", counts.leaving / hours),
                          absl::StrFormat("%.2f", Quantile(counts.reactions, 0.95)),
                          std::isfinite(counts.least_over_stopping)
                              ? absl::StrFormat("%.2f", counts.least_over_stopping)
                              : std::string("-"),
                          absl::StrCat(counts.scenes),
                          absl::StrFormat("%.1f", Percent(counts.unusable, counts.scenes)),
                          absl::StrFormat("%.2f", counts.processor_seconds / counts.episodes)});
  }
  if (figures.empty()) return "";
  const Counts& any = figures.front().counts;
  return absl::StrCat(
      absl::StrFormat("%d episodes, %.0f s, somebody inside the fence %.0f %% of the time\n",
                      any.episodes, any.seconds, 100 * any.PeopleShare()),
      TextOf(table));
}

nlohmann::ordered_json JsonOf(std::span<const MethodFigures> figures) {
  auto methods = nlohmann::ordered_json::array();
  for (const auto& [name, counts, to_curtain, to_oracle] : figures) {
    nlohmann::ordered_json row = {{"name", name},
                                  {"cycles_per_hour", counts.CyclesPerHour()},
                                  {"contacts_moving", counts.contacts_moving},
                                  {"contacts", counts.contacts},
                                  {"episodes", counts.episodes},
                                  {"people_share", counts.PeopleShare()},
                                  {"seconds", counts.seconds},
                                  {"stops", counts.stops},
                                  {"standing_seconds", counts.standing},
                                  {"moving_seconds", counts.moving},
                                  {"too_fast_seconds", counts.too_fast},
                                  {"leaving_seconds", counts.leaving},
                                  {"scenes", counts.scenes},
                                  {"unusable_scenes", counts.unusable},
                                  {"defects", counts.defects},
                                  {"reaction_seconds_median", Quantile(counts.reactions, 0.5)},
                                  {"reaction_seconds_95", Quantile(counts.reactions, 0.95)},
                                  {"distance_seconds", counts.distances},
                                  {"distance_bin", Counts::kBin},
                                  {"processor_seconds", counts.processor_seconds}};
    if (std::isfinite(counts.least_over_stopping)) {
      row["least_distance_over_stopping"] = counts.least_over_stopping;
    }
    AddRatio("to_curtain", to_curtain, row);
    AddRatio("to_oracle", to_oracle, row);
    methods.push_back(std::move(row));
  }
  return {{"methods", methods}};
}

absl::Status WriteCharts(std::span<const EpisodeResult> results,
                         std::span<const MethodFigures> figures, const std::string& folder) {
  // Of the episodes by their share of time with people.
  constexpr size_t kShares = 5;
  LineChart work{.title = "work",
                 .x_label = "time with people inside (%)",
                 .y_label = "cycles per hour",
                 .series = {}};
  LineChart distances{.title = "distance while the robot moves",
                      .x_label = "distance (m)",
                      .y_label = "share of the time (%)",
                      .series = {}};
  for (size_t i = 0; i < figures.size(); ++i) {
    std::array<Counts, kShares> by_share;
    for (const EpisodeResult& result : results) {
      if (result.method != figures[i].name) continue;
      const auto share =
          static_cast<size_t>(result.counts.PeopleShare() * static_cast<double>(kShares));
      by_share[std::min(share, kShares - 1)].Add(result.counts);
    }
    LineSeries& line = work.series.emplace_back(LineSeries{figures[i].name, SeriesColour(i), {}});
    for (const Counts& counts : by_share) {
      if (counts.episodes == 0) continue;
      line.points.push_back({100 * counts.PeopleShare(), counts.CyclesPerHour()});
    }
    LineSeries& histogram =
        distances.series.emplace_back(LineSeries{figures[i].name, SeriesColour(i), {}});
    const Counts& counts = figures[i].counts;
    for (size_t bin = 0; bin + 1 < Counts::kBins; ++bin) {
      histogram.points.push_back({Counts::kBin * (static_cast<double>(bin) + 0.5),
                                  Percent(counts.distances[bin], counts.moving)});
    }
  }
  RETURN_IF_ERROR(
      WritePng(absl::StrCat(folder, "/work.png"), Draw({work}, {.title = "", .columns = 1})));
  return WritePng(absl::StrCat(folder, "/distances.png"),
                  Draw({distances}, {.title = "", .columns = 1}));
}

}  // namespace silhouette::people_experiment
