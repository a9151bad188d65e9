// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/session_page.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/result/page.h"
#include "common/result/result.h"
#include "tools/silhouette-capture/templates.h"

namespace silhouette {
namespace {

using PageJson = nlohmann::ordered_json;

std::string Pixels(double value) {
  return std::isfinite(value) ? absl::StrFormat("%.2f", value) : "-";
}

PageJson TilesOf(const SessionFacts& facts) {
  const DatabaseStatistics& all = facts.statistics;
  const CaptureRepeatability& repeat = facts.repeatability;
  double shift = 0;
  for (const ViewRepeatability& view : repeat.views) {
    if (std::isfinite(view.greatest_shift)) shift = std::max(shift, view.greatest_shift);
  }
  return {Tile("captured", all.missing == 0 ? "good" : "fair", absl::StrCat(all.captured), "",
               absl::StrCat("of ", facts.configurations(), "; ", all.excluded, " excluded, ",
                            all.missing, " missing")),
          Tile("outliers", facts.mendable() == 0 ? "good" : "fair", absl::StrCat(facts.mendable()),
               "", absl::StrCat(all.damaged, " of them damaged")),
          Tile("suspect", facts.suspects.empty() ? "good" : "bad",
               absl::StrCat(facts.suspects.size()), "", "captured while the cell may have changed"),
          Tile("largest shift", repeat.checks == 0 ? "" : "good",
               repeat.checks == 0 ? "-" : Pixels(shift) + " px", "",
               absl::StrCat("over ", repeat.checks, " visits to the sentinels")),
          Tile("raw images", "", absl::StrCat(facts.raw_images), "",
               "configurations whose images were kept")};
}

// Null where there is but one.
PageJson VariantTable(const SessionFacts& facts) {
  if (facts.variants.size() < 2) return {};
  Table table{{"variant", "captured", "excluded", "damaged", "missing", "suspect", "this report"}};
  for (const VariantFacts& variant : facts.variants) {
    table.rows.push_back({variant.name, absl::StrCat(variant.captured),
                          absl::StrCat(variant.excluded), absl::StrCat(variant.damaged),
                          absl::StrCat(variant.missing), absl::StrCat(variant.suspect),
                          variant.name == facts.variant ? "is of this variant" : ""});
  }
  return JsonOf(table);
}

PageJson ViewTable(const SessionFacts& facts, const storage::v1::CellDescription& cell) {
  Table table{{"view", "least area, mask pixels", "mean area", "greatest area",
               "touching the border", "never left by the robot"}};
  for (int v = 0; v < cell.views_size(); ++v) {
    const auto place = static_cast<size_t>(v);
    const ViewStatistics& view = facts.statistics.views[place];
    table.rows.push_back({cell.views(v).name(), absl::StrCat(view.least_area),
                          absl::StrFormat("%.1f", view.mean_area), absl::StrCat(view.greatest_area),
                          absl::StrCat(facts.touching[place]),
                          absl::StrCat(view.permanent.Count())});
  }
  return JsonOf(table);
}

// Null if the sentinels were not visited yet.
PageJson RepeatabilityTable(const SessionFacts& facts) {
  const CaptureRepeatability& repeat = facts.repeatability;
  if (repeat.checks + repeat.alarms == 0) return {};
  Table table{{"view", "shift, rms, camera pixels", "largest", "mask pixels that differ", "most",
               "darkest", "brightest"}};
  for (const ViewRepeatability& view : repeat.views) {
    table.rows.push_back(
        {view.name, Pixels(view.shift), Pixels(view.greatest_shift),
         absl::StrFormat("%.1f", view.mask_pixels), absl::StrCat(view.most_mask_pixels),
         absl::StrFormat("%.3f", view.least_gain), absl::StrFormat("%.3f", view.greatest_gain)});
  }
  PageJson json = JsonOf(table);
  json["checks"] = repeat.checks;
  json["alarm_count"] = repeat.alarms;
  json["joint_rms"] = absl::StrFormat("%.5f", repeat.joint);
  json["joint_greatest"] = absl::StrFormat("%.5f", repeat.greatest_joint);
  return json;
}

// `time`: a format of absl::FormatTime, in the local time zone.
PageJson AlarmsOf(const SessionFacts& facts, const char* time) {
  PageJson alarms = PageJson::array();
  for (const storage::v1::SentinelCheck& check : facts.history.checks()) {
    if (check.alarm().empty()) continue;
    alarms.push_back({{"time", absl::FormatTime(time, TimeOf(check.time()), absl::LocalTimeZone())},
                      {"what", check.alarm()}});
  }
  return alarms;
}

nlohmann::ordered_json NumberOrNull(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

}  // namespace

std::string VerdictOf(const SessionFacts& facts) {
  if (facts.good()) return "All is captured, and nothing stands out";
  std::vector<std::string> parts;
  const auto add = [&](uint64_t count, const char* what) {
    if (count > 0) parts.push_back(absl::StrCat(count, " ", what));
  };
  add(facts.suspects.size(), "suspect");
  add(facts.mendable(), "outliers");
  add(facts.statistics.missing, "missing");
  std::string text;
  if (parts.empty())
    return "All is captured, but the cell was not as it had been when last looked at";
  for (size_t i = 0; i < parts.size(); ++i) {
    absl::StrAppend(&text, i == 0 ? "" : i + 1 == parts.size() ? " and " : ", ", parts[i]);
  }
  return absl::StrCat(text, " of ", facts.configurations(), " configurations");
}

std::string SessionPage(const SessionFacts& facts, const storage::v1::CellDescription& cell,
                        const std::vector<std::pair<std::string, std::string>>& origin,
                        const ReportPictures& pictures) {
  const auto figure = [&](const char* name, const char* caption, const char* alt) {
    const auto png = pictures.find(name);
    return png == pictures.end() ? PageJson() : PageJson(PngFigure(png->second, caption, alt));
  };
  const PageJson alarms = AlarmsOf(facts, "%a %Y-%m-%d %H:%M:%S");
  const PageJson json = {
      {"grade", facts.good()             ? "good"
                : facts.suspects.empty() ? "fair"
                                         : "bad"},
      {"says", VerdictOf(facts)},
      {"to_repair", !facts.repair.empty()},
      {"repair", facts.repair},
      {"tiles", TilesOf(facts)},
      {"coverage",
       figure("coverage",
              "Over two joints; where a cell stands for several configurations, the worst",
              "coverage of the configuration space")},
      {"variants", VariantTable(facts)},
      {"views", ViewTable(facts, cell)},
      {"repeatability", RepeatabilityTable(facts)},
      {"sentinel_history", figure("history", "The sentinel that differed most, per visit and view",
                                  "shift, mask pixels and brightness over time")},
      {"alarmed", !alarms.empty()},
      {"alarms", alarms},
      {"sentinels", figure("sentinels", "As the cameras saw them, with the robot's masks in blue",
                           "robot images of the sentinels")},
      {"outliers",
       figure("outliers", "To be looked at, at most 24", "robot images that stand out")},
      {"has_story", !facts.story.empty()},
      {"story_lines",
       facts.story_lines > facts.story.size() ? PageJson(facts.story_lines) : PageJson()},
      {"shown_lines", facts.story.size()},
      {"story", absl::StrJoin(facts.story, "\n") + "\n"}};
  return Page("Capture report", origin, Filled(templates::session_report_html, json));
}

nlohmann::ordered_json SessionJson(const SessionFacts& facts,
                                   const storage::v1::CellDescription& cell) {
  nlohmann::ordered_json json = {{"variant", facts.variant},
                                 {"variants", nlohmann::ordered_json::array()},
                                 {"verdict", VerdictOf(facts)},
                                 {"good", facts.good()},
                                 {"configurations", facts.configurations()},
                                 {"captured", facts.statistics.captured},
                                 {"excluded", facts.statistics.excluded},
                                 {"damaged", facts.statistics.damaged},
                                 {"missing", facts.statistics.missing},
                                 {"suspect", facts.suspects},
                                 {"outliers", nlohmann::ordered_json::array()},
                                 {"raw_images", facts.raw_images},
                                 {"views", nlohmann::ordered_json::array()},
                                 {"sentinel_checks", facts.repeatability.checks},
                                 {"alarms", AlarmsOf(facts, absl::RFC3339_sec)},
                                 {"joint_rms", facts.repeatability.joint},
                                 {"joint_greatest", facts.repeatability.greatest_joint},
                                 {"repair", facts.repair}};
  for (const VariantFacts& variant : facts.variants) {
    json["variants"].push_back(JsonOf(variant));
    json["variants"].back()["name"] = variant.name;
  }
  for (const Outlier& outlier : facts.outliers) {
    json["outliers"].push_back(
        {{"configuration", outlier.number},
         {"reason", NameOf(outlier.reason)},
         {"view", outlier.view < 0 ? std::string() : cell.views(outlier.view).name()}});
  }
  for (size_t v = 0; v < facts.repeatability.views.size(); ++v) {
    const ViewRepeatability& repeat = facts.repeatability.views[v];
    const ViewStatistics& view = facts.statistics.views[v];
    json["views"].push_back({{"name", repeat.name},
                             {"least_area", view.least_area},
                             {"mean_area", view.mean_area},
                             {"greatest_area", view.greatest_area},
                             {"touching_border", facts.touching[v]},
                             {"shift_rms", NumberOrNull(repeat.shift)},
                             {"shift_greatest", NumberOrNull(repeat.greatest_shift)},
                             {"mask_pixels_mean", repeat.mask_pixels},
                             {"mask_pixels_most", repeat.most_mask_pixels},
                             {"gain_least", repeat.least_gain},
                             {"gain_greatest", repeat.greatest_gain}});
  }
  return json;
}

}  // namespace silhouette
