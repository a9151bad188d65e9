#include "tools/silhouette-capture/tune_page.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/page/page.h"

namespace silhouette {
namespace {

using Cells = std::vector<std::string>;

double TunePageShare(int64_t part, int64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::string Percent(int64_t part, int64_t whole) {
  return whole == 0 ? "-" : absl::StrFormat("%.3f %%", 100 * TunePageShare(part, whole));
}

std::string Change(int64_t gained, int64_t lost) { return absl::StrCat("+", gained, " -", lost); }

Cells Headings() {
  return {"settings", "foreground",  "false, empty cell", "areas", "specks", "close",
          "pixels",   "mask pixels", "to recorded masks"};
}

// `first`: the row that gains and losses are against.
Cells TunePageRow(const std::string& name, const TuneFigures& figures, bool first) {
  return {
      name,
      Percent(figures.foreground, figures.pixels),
      Percent(figures.false_pixels, figures.empty_pixels),
      absl::StrCat(figures.areas),
      absl::StrCat(figures.specks),
      Percent(figures.close, figures.pixels),
      first ? "" : Change(figures.gained, figures.lost),
      first ? absl::StrCat(figures.mask_pixels) : Change(figures.mask_gained, figures.mask_lost),
      figures.recorded == 0 ? "-" : Change(figures.recorded_added, figures.recorded_removed)};
}

std::string HtmlRow(const Cells& cells, const char* element) {
  std::string row = "<tr>";
  for (const std::string& cell : cells) {
    absl::StrAppend(&row, "<", element, ">", Escaped(cell), "</", element, ">");
  }
  return row + "</tr>\n";
}

std::string HtmlTable(const std::vector<TuneVariant>& variants,
                      const std::vector<TuneFigures>& figures) {
  std::string html = "<table>\n" + HtmlRow(Headings(), "th");
  for (size_t v = 0; v < variants.size(); ++v) {
    html += HtmlRow(TunePageRow(variants[v].name, figures[v], v == 0), "td");
  }
  return html + "</table>\n";
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

std::string Explanation(const TuneResult& result) {
  return absl::StrCat(
      "<p class=\"soft\">Foreground: share of the camera pixels. False: the same of images of the "
      "empty cell, where all foreground is. Areas: of foreground that hangs together. Specks: "
      "pixels that differ and were dropped (clean_up_radius, min_blob_pixels). Close: pixels that "
      "differ by 0.7 to 1.4 times their limit. Pixels and mask pixels: what is found, and is not, "
      "otherwise than with ",
      Escaped(result.variants.front().name),
      " settings. To recorded masks: mask pixels that remask would add and remove.</p>\n");
}

}  // namespace

std::string TuneTable(const TuneResult& result) {
  std::vector<Cells> rows = {Headings()};
  for (size_t v = 0; v < result.variants.size(); ++v) {
    rows.push_back(TunePageRow(result.variants[v].name, result.sums[v], v == 0));
  }
  std::string text;
  for (const Cells& row : rows) {
    for (size_t c = 0; c < row.size(); ++c) {
      size_t width = 0;
      for (const Cells& each : rows) width = std::max(width, each[c].size());
      const std::string space(width - row[c].size(), ' ');
      absl::StrAppend(&text, c == 0 ? "" : "  ", c == 0 ? row[c] + space : space + row[c]);
    }
    text += "\n";
  }
  return text;
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
  std::string html = absl::StrCat("<h2>All images</h2>\n<div class=\"card\">",
                                  HtmlTable(result.variants, result.sums), Explanation(result),
                                  "</div>\n<h2>To use what was tried</h2>\n<div class=\"card\">");
  for (const std::string& line : result.advice) {
    absl::StrAppend(&html, "<p><code>", Escaped(line), "</code></p>\n");
  }
  html += "</div>\n";
  for (const TuneEntry& image : result.images) {
    absl::StrAppend(&html, "<h2>", Escaped(image.name), image.empty ? ", the empty cell" : "",
                    "</h2>\n<div class=\"card\">",
                    PngFigure(image.sheet_png, "What each of the settings finds", image.name),
                    HtmlTable(result.variants, image.figures), "</div>\n");
  }
  return Page("Segmentation settings compared", origin, html);
}

}  // namespace silhouette
