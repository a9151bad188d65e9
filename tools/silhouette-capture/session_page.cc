#include "tools/silhouette-capture/session_page.h"

#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/page/page.h"

namespace silhouette {
namespace {

std::string Pixels(double value) {
  return std::isfinite(value) ? absl::StrFormat("%.2f", value) : "-";
}

std::string SessionPageRow(const std::vector<std::string>& cells, const char* element) {
  std::string row = "<tr>";
  for (const std::string& cell : cells) {
    absl::StrAppend(&row, "<", element, ">", Escaped(cell), "</", element, ">");
  }
  return row + "</tr>\n";
}

std::string Tile(const char* grade, const std::string& name, const std::string& value,
                 const std::string& more) {
  return absl::StrCat("<div class=\"tile ", grade, "\"><div class=\"name\">", Escaped(name),
                      "</div><div class=\"value\">", Escaped(value), "</div><div class=\"more\">",
                      Escaped(more), "</div></div>\n");
}

std::string Tiles(const SessionFacts& facts) {
  const DatabaseStatistics& all = facts.statistics;
  const CaptureRepeatability& repeat = facts.repeatability;
  double shift = 0;
  for (const ViewRepeatability& view : repeat.views) {
    if (std::isfinite(view.greatest_shift)) shift = std::max(shift, view.greatest_shift);
  }
  return absl::StrCat(
      "<div class=\"tiles\">\n",
      Tile(all.missing == 0 ? "good" : "fair", "captured", absl::StrCat(all.captured),
           absl::StrCat("of ", facts.configurations(), "; ", all.excluded, " excluded, ",
                        all.missing, " missing")),
      Tile(facts.mendable() == 0 ? "good" : "fair", "outliers", absl::StrCat(facts.mendable()),
           absl::StrCat(all.damaged, " of them damaged")),
      Tile(facts.suspects.empty() ? "good" : "bad", "suspect", absl::StrCat(facts.suspects.size()),
           "captured while the cell may have been changed"),
      Tile(repeat.checks == 0 ? "" : "good", "largest shift",
           repeat.checks == 0 ? "-" : Pixels(shift) + " px",
           absl::StrCat("over ", repeat.checks, " visits to the sentinels")),
      Tile("", "raw images", absl::StrCat(facts.raw_images),
           "configurations whose images were kept"),
      "</div>\n");
}

std::string Verdict(const SessionFacts& facts) {
  const char* grade = facts.good() ? "good" : facts.suspects.empty() ? "fair" : "bad";
  std::string html = absl::StrCat("<div class=\"verdict ", grade, "\"><strong>",
                                  Escaped(VerdictOf(facts)), "</strong>\n");
  if (!facts.repair.empty()) {
    absl::StrAppend(&html, "<p>To repair it, one after the other:</p>\n<ul>\n");
    for (const std::string& command : facts.repair) {
      absl::StrAppend(&html, "<li><code>", Escaped(command), "</code></li>\n");
    }
    html += "</ul>\n";
  }
  return html + "</div>\n";
}

// Nothing where there is but one.
std::string VariantTable(const SessionFacts& facts) {
  if (facts.variants.size() < 2) return "";
  std::string html = "<h2>Variants</h2>\n<div class=\"card\"><table>\n" +
                     SessionPageRow({"variant", "captured", "excluded", "damaged", "missing",
                                     "suspect", "this report"},
                                    "th");
  for (const VariantFacts& variant : facts.variants) {
    html += SessionPageRow(
        {variant.name, absl::StrCat(variant.captured), absl::StrCat(variant.excluded),
         absl::StrCat(variant.damaged), absl::StrCat(variant.missing),
         absl::StrCat(variant.suspect), variant.name == facts.variant ? "is of this variant" : ""},
        "td");
  }
  return html +
         "</table>\n<p class=\"soft\">silhouette-capture report --variant NAME has the others.</p>"
         "</div>\n";
}

std::string ViewTable(const SessionFacts& facts, const storage::v1::CellDescription& cell) {
  std::string html =
      "<h2>Views</h2>\n<div class=\"card\"><table>\n" +
      SessionPageRow({"view", "least area, mask pixels", "mean area", "greatest area",
                      "touching the border", "never left by the robot"},
                     "th");
  for (int v = 0; v < cell.views_size(); ++v) {
    const auto place = static_cast<size_t>(v);
    const ViewStatistics& view = facts.statistics.views[place];
    html +=
        SessionPageRow({cell.views(v).name(), absl::StrCat(view.least_area),
                        absl::StrFormat("%.1f", view.mean_area), absl::StrCat(view.greatest_area),
                        absl::StrCat(facts.touching[place]), absl::StrCat(view.permanent.Count())},
                       "td");
  }
  return html +
         "</table>\n<p class=\"soft\">The robot must be wholly visible in every view: where it "
         "touches the border, move the camera back or turn it.</p></div>\n";
}

std::string RepeatabilityTable(const SessionFacts& facts) {
  const CaptureRepeatability& repeat = facts.repeatability;
  if (repeat.checks + repeat.alarms == 0) {
    return "<h2>Repeatability</h2>\n<div class=\"card\">The sentinels were not visited "
           "yet.</div>\n";
  }
  std::string html = "<h2>Repeatability</h2>\n<div class=\"card\"><table>\n" +
                     SessionPageRow({"view", "shift, rms, camera pixels", "largest",
                                     "mask pixels that differ", "most", "darkest", "brightest"},
                                    "th");
  for (const ViewRepeatability& view : repeat.views) {
    html += SessionPageRow(
        {view.name, Pixels(view.shift), Pixels(view.greatest_shift),
         absl::StrFormat("%.1f", view.mask_pixels), absl::StrCat(view.most_mask_pixels),
         absl::StrFormat("%.3f", view.least_gain), absl::StrFormat("%.3f", view.greatest_gain)},
        "td");
  }
  return absl::StrCat(
      html, "</table>\n<p class=\"soft\">",
      absl::StrFormat(
          "%d visits to the sentinels found all as it was, %d did not. Joints came back "
          "to within %.5f rad or m (rms), %.5f at most.",
          repeat.checks, repeat.alarms, repeat.joint, repeat.greatest_joint),
      "</p></div>\n");
}

std::string Alarms(const SessionFacts& facts) {
  std::string html;
  for (const storage::v1::SentinelCheck& check : facts.history.checks()) {
    if (check.alarm().empty()) continue;
    absl::StrAppend(
        &html, "<dt>",
        absl::FormatTime("%a %Y-%m-%d %H:%M:%S", TimeOf(check.time()), absl::LocalTimeZone()),
        "</dt><dd>", Escaped(check.alarm()), "</dd>\n");
  }
  if (html.empty()) return "";
  return "<h2>When the cell was not as it had been</h2>\n<div class=\"card\"><dl>\n" + html +
         "</dl></div>\n";
}

std::string Story(const SessionFacts& facts) {
  if (facts.story.empty()) return "";
  std::string html = "<h2>The story</h2>\n<div class=\"card\">";
  if (facts.story_lines > facts.story.size()) {
    absl::StrAppend(&html, "<p class=\"soft\">The last ", facts.story.size(), " of ",
                    facts.story_lines, " lines of the log.</p>");
  }
  html += "<pre style=\"white-space:pre-wrap;margin:0\">";
  for (const std::string& line : facts.story) absl::StrAppend(&html, Escaped(line), "\n");
  return html + "</pre></div>\n";
}

std::string Card(const std::string& title, const std::string& figure) {
  return absl::StrCat("<h2>", title, "</h2>\n<div class=\"card\">\n", figure, "</div>\n");
}

nlohmann::json NumberOrNull(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
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
  std::string html = Verdict(facts) + Tiles(facts);
  html +=
      Card("Coverage",
           PngFigure(pictures.coverage,
                     "Over two joints; where a cell stands for several configurations, the worst",
                     "coverage of the configuration space"));
  html += VariantTable(facts);
  html += ViewTable(facts, cell);
  html += RepeatabilityTable(facts);
  if (pictures.history) {
    html += Card("Sentinels over time",
                 PngFigure(*pictures.history, "The sentinel that differed most, per visit and view",
                           "shift, mask pixels and brightness over time"));
  }
  html += Alarms(facts);
  html += Card("Sentinels", PngFigure(pictures.sentinels,
                                      "As the cameras saw them, with the robot's masks in blue",
                                      "robot images of the sentinels"));
  if (pictures.outliers) {
    html += Card("Outliers", PngFigure(*pictures.outliers, "To be looked at, at most 24",
                                       "robot images that stand out"));
  }
  html += Story(facts);
  return Page("Capture report", origin, html);
}

nlohmann::json SessionJson(const SessionFacts& facts, const storage::v1::CellDescription& cell) {
  nlohmann::json json = {{"variant", facts.variant},
                         {"variants", nlohmann::json::array()},
                         {"verdict", VerdictOf(facts)},
                         {"good", facts.good()},
                         {"configurations", facts.configurations()},
                         {"captured", facts.statistics.captured},
                         {"excluded", facts.statistics.excluded},
                         {"damaged", facts.statistics.damaged},
                         {"missing", facts.statistics.missing},
                         {"suspect", facts.suspects},
                         {"outliers", nlohmann::json::array()},
                         {"raw_images", facts.raw_images},
                         {"views", nlohmann::json::array()},
                         {"sentinel_checks", facts.repeatability.checks},
                         {"alarms", nlohmann::json::array()},
                         {"joint_rms", facts.repeatability.joint},
                         {"joint_greatest", facts.repeatability.greatest_joint},
                         {"repair", facts.repair}};
  for (const VariantFacts& variant : facts.variants) {
    json["variants"].push_back({{"name", variant.name},
                                {"captured", variant.captured},
                                {"excluded", variant.excluded},
                                {"damaged", variant.damaged},
                                {"missing", variant.missing},
                                {"suspect", variant.suspect}});
  }
  for (const Outlier& outlier : facts.outliers) {
    json["outliers"].push_back(
        {{"configuration", outlier.number},
         {"reason", NameOf(outlier.reason)},
         {"view", outlier.view < 0 ? std::string() : cell.views(outlier.view).name()}});
  }
  for (const storage::v1::SentinelCheck& check : facts.history.checks()) {
    if (check.alarm().empty()) continue;
    json["alarms"].push_back(
        {{"time", absl::FormatTime(TimeOf(check.time()))}, {"what", check.alarm()}});
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
