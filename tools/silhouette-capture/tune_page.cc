// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/tune_page.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/result/page.h"
#include "common/result/result.h"
#include "tools/silhouette-capture/templates.h"

namespace silhouette {
namespace {

double TunePageShare(int64_t part, int64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::string Percent(int64_t part, int64_t whole) {
  return whole == 0 ? "-" : absl::StrFormat("%.3f %%", 100 * TunePageShare(part, whole));
}

std::string Change(int64_t gained, int64_t lost) { return absl::StrCat("+", gained, " -", lost); }

// A line per variant; gains and losses are against the first one.
Table TableOf(const std::vector<TuneVariant>& variants, const std::vector<TuneFigures>& figures) {
  Table table{{"settings", "foreground", "false, empty cell", "areas", "specks", "close", "pixels",
               "mask pixels", "to recorded masks"}};
  for (size_t v = 0; v < variants.size(); ++v) {
    const TuneFigures& f = figures[v];
    table.rows.push_back({variants[v].name, Percent(f.foreground, f.pixels),
                          Percent(f.false_pixels, f.empty_pixels), absl::StrCat(f.areas),
                          absl::StrCat(f.specks), Percent(f.close, f.pixels),
                          v == 0 ? "" : Change(f.gained, f.lost),
                          v == 0 ? absl::StrCat(f.mask_pixels) : Change(f.mask_gained, f.mask_lost),
                          f.recorded == 0 ? "-" : Change(f.recorded_added, f.recorded_removed)});
  }
  return table;
}

nlohmann::json TunePageJsonOf(const TuneFigures& figures) {
  nlohmann::json json = {{"pixels", figures.pixels},
                         {"foreground", figures.foreground},
                         {"areas", figures.areas},
                         {"specks", figures.specks},
                         {"close", figures.close},
                         {"gained", figures.gained},
                         {"lost", figures.lost},
                         {"mask_pixels", figures.mask_pixels},
                         {"mask_gained", figures.mask_gained},
                         {"mask_lost", figures.mask_lost}};
  if (figures.empty_pixels > 0) {
    json["false_share"] = TunePageShare(figures.false_pixels, figures.empty_pixels);
  }
  if (figures.recorded > 0) {
    json["recorded_mask_pixels"] = figures.recorded;
    json["recorded_added"] = figures.recorded_added;
    json["recorded_removed"] = figures.recorded_removed;
  }
  return json;
}

}  // namespace

std::string TuneTable(const TuneResult& result) {
  return TextOf(TableOf(result.variants, result.sums));
}

nlohmann::json TuneJson(const TuneResult& result) {
  nlohmann::json json = {{"variants", nlohmann::json::array()},
                         {"images", nlohmann::json::array()},
                         {"advice", result.advice}};
  for (size_t v = 0; v < result.variants.size(); ++v) {
    nlohmann::json variant = TunePageJsonOf(result.sums[v]);
    variant["name"] = result.variants[v].name;
    variant["cell_file_line"] = CellFileLine(result.variants[v].settings);
    json["variants"].push_back(variant);
  }
  for (const TuneEntry& image : result.images) {
    nlohmann::json figures = nlohmann::json::array();
    for (const TuneFigures& each : image.figures) figures.push_back(TunePageJsonOf(each));
    json["images"].push_back({{"name", image.name},
                              {"empty", image.empty},
                              {"sheet", image.sheet},
                              {"figures", figures}});
  }
  return json;
}

std::string TunePage(const TuneResult& result,
                     const std::vector<std::pair<std::string, std::string>>& origin) {
  nlohmann::ordered_json json = {{"sums", JsonOf(TableOf(result.variants, result.sums))},
                                 {"first", result.variants.front().name},
                                 {"advice", result.advice},
                                 {"images", nlohmann::ordered_json::array()}};
  for (const TuneEntry& image : result.images) {
    json["images"].push_back(
        {{"name", image.name},
         {"empty", image.empty},
         {"picture", PngFigure(image.sheet_png, "What each of the settings finds", image.name)},
         {"table", JsonOf(TableOf(result.variants, image.figures))}});
  }
  return Page("Segmentation settings compared", origin, Filled(templates::tune_html, json));
}

}  // namespace silhouette
