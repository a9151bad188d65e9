// SPDX-License-Identifier: Apache-2.0
#include "calib/report/report_page.h"

#include <algorithm>
#include <array>
#include <functional>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/report/templates.h"
#include "common/result/page.h"
#include "common/result/result.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

const char* NameOf(HeldOutBy by) {
  return std::array{"nothing", "frames", "boards"}[static_cast<size_t>(by)];
}

constexpr char kDash[] = "\u2013";

// The view of the worst grade, and among such of the largest `value`; null if none has one.
template <typename GradeIt, typename Value>
const ReportView* Worst(const QualityReport& report, const GradeIt& grade, const Value& value) {
  const ReportView* worst = nullptr;
  for (const ReportView& view : report.views) {
    if (!(value(view) > 0)) continue;
    if (worst == nullptr ||
        std::pair(grade(view), value(view)) > std::pair(grade(*worst), value(*worst))) {
      worst = &view;
    }
  }
  return worst;
}

Json UnknownTile(const std::string& name, const std::string& why) {
  return Tile(name, NameOf(Grade::kUnknown), kDash, "", why);
}

// The figure of the worst view; `more`: the rest of what it says of that view.
template <typename GradeIt, typename Value, typename More>
Json ViewTile(const QualityReport& report, const std::string& name, const GradeIt& grade,
              const Value& value, const More& more) {
  const ReportView* view = Worst(report, grade, value);
  if (view == nullptr) return UnknownTile(name, "not known");
  return Tile(name, NameOf(grade(*view)), PixelText(value(*view)), "px",
              absl::StrCat("worst view, ", view->name, "; ", more(*view)));
}

Json HeldOutTile(const QualityReport& report) {
  return ViewTile(
      report, "Held-out corners", [](const ReportView& v) { return GradeOf(v.held_out); },
      [](const ReportView& v) { return v.held_out.corners > 0 ? v.held_out.px : 0; },
      [](const ReportView& v) { return "expected " + PixelText(v.held_out.expected_px); });
}

Json LineTile(const QualityReport& report) {
  const auto worst = std::ranges::max_element(report.pairs, {}, [&](const ReportPair& pair) {
    return std::pair(GradeOfLines(pair, report), pair.px);
  });
  if (worst == report.pairs.end() || worst->corners == 0) {
    return UnknownTile("Epipolar lines, held out", "no corners seen by two views");
  }
  return Tile("Epipolar lines, held out", NameOf(GradeOfLines(*worst, report)),
              PixelText(worst->px), "px",
              absl::StrCat("worst pair, ", worst->view_a, " - ", worst->view_b));
}

Json PredictionTile(const QualityReport& report) {
  return ViewTile(
      report, "Predicted, workspace",
      [](const ReportView& v) { return GradeOf(v.predicted, v.width); },
      [](const ReportView& v) { return v.predicted.px; },
      [](const ReportView& v) { return absl::StrFormat("%.2f mm", v.predicted.mm); });
}

Json RepeatabilityTile(const QualityReport& report) {
  return ViewTile(
      report, "Repeatability",
      [](const ReportView& v) { return GradeOf(*v.repeatability, v.predicted); },
      [](const ReportView& v) { return v.repeatability ? v.repeatability->px : 0; },
      [](const ReportView& v) {
        return absl::StrFormat("%.2f mm, %.3f\u00b0", v.repeatability->mm, v.repeatability->deg);
      });
}

TableCell Graded(Grade grade, const std::string& text, const std::string& small = "") {
  return {text, NameOf(grade), small};
}

// A value with another one in parentheses: "0.123 (0.100)".
TableCell Graded(Grade grade, double px, double other_px) {
  return Graded(grade, PixelText(px), absl::StrCat("(", PixelText(other_px), ")"));
}

TableCell HeldOutCell(const HeldOutError& error) {
  if (error.corners == 0) return TableCell::Unknown();
  return Graded(GradeOf(error), error.px, error.expected_px);
}

TableCell PredictedCell(const ReportView& view) {
  if (view.predicted.points == 0) return TableCell::Unknown();
  return Graded(GradeOf(view.predicted, view.width), view.predicted.px, view.predicted.worst_px);
}

TableCell RepeatabilityCell(const ReportView& view) {
  if (!view.repeatability) return TableCell::Unknown();
  return Graded(
      GradeOf(*view.repeatability, view.predicted), PixelText(view.repeatability->px),
      absl::StrFormat("%.2f mm %.3f\u00b0", view.repeatability->mm, view.repeatability->deg));
}

TableCell HalvesCell(const ReportView& view) {
  if (!view.halves) return TableCell::Unknown();
  return Graded(GradeOf(*view.halves), view.halves->px, view.halves->expected_px);
}

TableCell TiltCell(const ReportView& view) {
  if (!view.tilt_deg) return TableCell::Unknown();
  return Graded(GradeOfTilt(view), absl::StrFormat("%.0f\u00b0", *view.tilt_deg));
}

TableCell ReachCell(const ReportView& view, bool solved) {
  if (!solved) return absl::StrFormat("%.0f %%", 100 * view.coverage);
  if (view.predicted.points == 0) return TableCell::Unknown();
  return Graded(GradeOfCoverage(view), absl::StrFormat("%.0f %%", 100 * view.reached));
}

Table ViewTable(const QualityReport& report) {
  const bool solved = report.refusal.empty();
  Table table{{"view", "frames", "corners<br>(left out)", "tilts",
               solved ? "workspace<br>covered" : "image<br>covered"}};
  if (solved) {
    for (const char* heading :
         {"fit<br>px", "held out<br>px (expected)", "predicted<br>px (worst)", "predicted<br>mm",
          "repeatability<br>px", "halves<br>px (expected)"}) {
      table.headings.push_back(heading);
    }
  }
  for (const ReportView& view : report.views) {
    TableCell name(view.name, solved ? NameOf(GradeOf(view)) : "",
                   view.on_flange ? "on the flange" : "");
    name.bold = true;
    table.rows.push_back(
        {name, absl::StrCat(view.frames),
         TableCell(absl::StrCat(view.corners), "", absl::StrCat("(", view.outliers, ")")),
         TiltCell(view), ReachCell(view, solved)});
    if (!solved) continue;
    for (TableCell cell :
         {TableCell(PixelText(view.fit_px)), HeldOutCell(view.held_out), PredictedCell(view),
          TableCell(absl::StrFormat("%.2f", view.predicted.mm)), RepeatabilityCell(view),
          HalvesCell(view)}) {
      table.rows.back().push_back(std::move(cell));
    }
  }
  return table;
}

Table PairTable(const QualityReport& report) {
  Table table{{"pair", "seen at once", "held-out corners", "rms px", "median px", "worst px"}};
  table.narrow = true;
  for (const ReportPair& pair : report.pairs) {
    const auto number = [&](double px) {
      return pair.corners > 0 ? TableCell(PixelText(px)) : TableCell::Unknown();
    };
    table.rows.push_back(
        {Graded(GradeOfLines(pair, report), absl::StrCat(pair.view_a, " - ", pair.view_b)),
         absl::StrCat(pair.seen), absl::StrCat(pair.corners), number(pair.px),
         number(pair.median_px), number(pair.worst_px)});
  }
  return table;
}

// The images that stand out; null if none does.
Json WorstImages(const QualityReport& report) {
  constexpr size_t kMost = 15;
  const auto excess = [](const ReportImage& image) {
    const HeldOutError& error = image.held_out;
    return 100 * image.outliers + (error.expected_px > 0 ? error.px / error.expected_px : 0);
  };
  std::vector<ReportImage> worst;
  for (const ReportImage& image : report.images) {
    if (image.outliers > 0 || GradeOf(image.held_out) == Grade::kBad) worst.push_back(image);
  }
  if (worst.empty()) return {};
  std::ranges::stable_sort(worst, std::greater(), excess);
  Table table{{"image", "view", "corners", "left out", "fit px", "held out px (expected)"}};
  table.narrow = true;
  for (size_t i = 0; i < std::min(kMost, worst.size()); ++i) {
    const ReportImage& image = worst[i];
    table.rows.push_back({image.frame, image.view, absl::StrCat(image.corners),
                          absl::StrCat(image.outliers), PixelText(image.fit_px),
                          HeldOutCell(image.held_out)});
  }
  Json json = JsonOf(table);
  json["more"] = worst.size() > kMost ? Json(worst.size() - kMost) : Json();
  return json;
}

Json ViewFigures(const ReportView& view) {
  const std::string prediction = PredictionFigure(view);
  return {{"name", view.name},
          {"grade", NameOf(GradeOf(view))},
          {"width", view.width},
          {"height", view.height},
          {"held_out", view.held_out.corners > 0},
          {"residuals", ResidualFigure(view)},
          {"coverage", CoverageFigure(view)},
          {"prediction", prediction.empty() ? Json() : Json(prediction)}};
}

std::string VerdictOn(const QualityReport& report) {
  const size_t warnings = report.warnings.size();
  if (!report.refusal.empty()) return absl::StrCat("No calibration: ", report.refusal);
  if (warnings == 0) return "Nothing to warn of";
  return warnings == 1 ? "One warning" : absl::StrCat(warnings, " warnings");
}

Json NoiseText(double factor) {
  return factor > 0 ? Json(absl::StrFormat("%.2f", factor)) : Json();
}

// What report.html shows.
Json PageJson(const QualityReport& report) {
  Json json = {{"grade", NameOf(GradeOf(report))},
               {"says", VerdictOn(report)},
               {"warned", !report.warnings.empty()},
               {"warnings", report.warnings},
               {"solved", report.refusal.empty()},
               {"cameras", JsonOf(ViewTable(report))},
               {"views", Json::array()},
               {"pairs", report.pairs.empty() ? Json() : JsonOf(PairTable(report))},
               {"images", ImageFigure(report)},
               {"worst_images", WorstImages(report)},
               {"groups", report.groups},
               {"groups_of", nullptr},
               {"workspace", report.workspace},
               {"image_noise", absl::StrFormat("%.2f", report.image_noise_factor)},
               {"robot_noise", NoiseText(report.robot_noise_factor)},
               {"survey_noise", NoiseText(report.survey_noise_factor)}};
  if (report.held_out_by != HeldOutBy::kNothing) json["groups_of"] = NameOf(report.held_out_by);
  for (const ReportView& view : report.views) json["views"].push_back(ViewFigures(view));
  json["tiles"] = {
      HeldOutTile(report), LineTile(report), PredictionTile(report), RepeatabilityTile(report),
      Tile("\u03c7\u00b2 per degree of freedom", NameOf(GradeOfChi2(report.chi2_per_dof)),
           absl::StrFormat("%.2f", report.chi2_per_dof), "",
           absl::StrFormat("1 if sigmas are right; %d degrees of freedom", report.dof))};
  return json;
}

Json JsonOf(const HeldOutError& error) {
  if (error.corners == 0) return nullptr;
  return {{"corners", error.corners}, {"px", error.px}, {"expected_px", error.expected_px}};
}

Json JsonOf(const PredictedError& predicted) {
  if (predicted.points == 0) return nullptr;
  return {{"points", predicted.points},
          {"px", predicted.px},
          {"worst_px", predicted.worst_px},
          {"mm", predicted.mm}};
}

// Null in fields of which nothing is known.
Json JsonOf(const ImageMap& map, bool solved) {
  Json json = {{"columns", map.columns}, {"rows", map.rows}};
  for (const char* key : {"corners", "mean_x_px", "mean_y_px", "fit_px", "predicted_px"}) {
    json[key] = Json::array();
  }
  for (const MapCell& cell : map.cells) {
    const bool seen = solved && cell.corners > 0;
    json["corners"].push_back(cell.corners);
    json["mean_x_px"].push_back(seen ? Json(cell.mean.x()) : Json());
    json["mean_y_px"].push_back(seen ? Json(cell.mean.y()) : Json());
    json["fit_px"].push_back(seen ? Json(cell.fit_px) : Json());
    json["predicted_px"].push_back(cell.points > 0 ? Json(cell.predicted_px) : Json());
  }
  return json;
}

Json JsonOf(const ReportView& view, bool solved) {
  Json json = {{"name", view.name},
               {"world", view.on_flange ? "flange" : "base"},
               {"grade", solved ? NameOf(GradeOf(view)) : "unknown"},
               {"image_size", {view.width, view.height}},
               {"frames", view.frames},
               {"corners", view.corners},
               {"outliers", view.outliers},
               {"span", {view.span_x, view.span_y}},
               {"coverage", view.coverage},
               {"workspace_reached", view.predicted.points > 0 ? Json(view.reached) : Json()},
               {"tilt_deg", view.tilt_deg ? Json(*view.tilt_deg) : Json()},
               {"fit_px", solved ? Json(view.fit_px) : Json()},
               {"held_out", JsonOf(view.held_out)},
               {"predicted", JsonOf(view.predicted)}};
  json["repeatability"] = nullptr;
  if (const auto& r = view.repeatability) {
    json["repeatability"] = {{"px", r->px}, {"mm", r->mm}, {"deg", r->deg}};
  }
  json["halves"] = nullptr;
  if (const auto& halves = view.halves) {
    json["halves"] = {{"px", halves->px}, {"expected_px", halves->expected_px}};
  }
  json["map"] = JsonOf(view.map, solved);
  return json;
}

Json JsonOf(const ReportPair& pair) {
  const bool known = pair.corners > 0;
  return {{"view_a", pair.view_a},
          {"view_b", pair.view_b},
          {"seen_at_once", pair.seen},
          {"corners", pair.corners},
          {"epipolar_px", known ? Json(pair.px) : Json()},
          {"median_px", known ? Json(pair.median_px) : Json()},
          {"worst_px", known ? Json(pair.worst_px) : Json()}};
}

Json JsonOf(const ReportImage& image, bool solved) {
  return {{"frame", image.frame},
          {"view", image.view},
          {"corners", image.corners},
          {"outliers", image.outliers},
          {"fit_px", solved ? Json(image.fit_px) : Json()},
          {"held_out", JsonOf(image.held_out)}};
}

Json JsonOf(const ReportFrame& frame) {
  Json json = {{"name", frame.name}, {"robot", nullptr}};
  if (frame.robot) {
    json["robot"] = {
        {"mm", frame.robot_mm}, {"deg", frame.robot_deg}, {"outlier", frame.robot_outlier}};
  }
  return json;
}

Json FactorOf(double factor) { return factor > 0 ? Json(factor) : Json(); }

}  // namespace

std::string PixelText(double px) {
  return px < 1 ? absl::StrFormat("%.3f", px) : absl::StrFormat("%.2f", px);
}

std::string ReportHtml(const QualityReport& report,
                       const std::vector<std::pair<std::string, std::string>>& origin) {
  return Page("Calibration report", origin, Filled(templates::report_html, PageJson(report)));
}

Json ReportJson(const QualityReport& report) {
  const bool solved = report.refusal.empty();
  Json json = {{"refusal", solved ? Json() : Json(report.refusal)},
               {"grade", NameOf(GradeOf(report))},
               {"warnings", report.warnings},
               {"chi2_per_dof", solved ? Json(report.chi2_per_dof) : Json()},
               {"dof", report.dof},
               {"image_noise_factor", FactorOf(report.image_noise_factor)},
               {"robot_noise_factor", FactorOf(report.robot_noise_factor)},
               {"survey_noise_factor", FactorOf(report.survey_noise_factor)},
               {"held_out_by", NameOf(report.held_out_by)},
               {"groups", report.groups},
               {"workspace", report.workspace}};
  for (const char* key : {"views", "pairs", "images", "frames"}) json[key] = Json::array();
  for (const ReportView& view : report.views) json["views"].push_back(JsonOf(view, solved));
  for (const ReportPair& pair : report.pairs) json["pairs"].push_back(JsonOf(pair));
  for (const ReportImage& image : report.images) json["images"].push_back(JsonOf(image, solved));
  for (const ReportFrame& frame : report.frames) json["frames"].push_back(JsonOf(frame));
  return json;
}

std::string ReportText(const QualityReport& report) {
  std::string text;
  if (report.refusal.empty()) {
    Table table{{"view", "corners", "fit px", "held out (exp.)", "predicted (worst)",
                 "repeatability", "halves (exp.)"}};
    for (const ReportView& view : report.views) {
      TableCell repeatability = RepeatabilityCell(view);
      repeatability.small.clear();
      table.rows.push_back({view.name, absl::StrCat(view.corners), PixelText(view.fit_px),
                            HeldOutCell(view.held_out), PredictedCell(view), repeatability,
                            HalvesCell(view)});
    }
    text = TextOf(table);
    for (const ReportPair& pair : report.pairs) {
      if (pair.corners == 0) continue;
      absl::StrAppendFormat(&text, "%s - %s: %d held-out corners, %.3f px from their lines\n",
                            pair.view_a, pair.view_b, pair.corners, pair.px);
    }
    absl::StrAppendFormat(&text, "chi2/dof %.2f; all in pixels; workspace: %s\n",
                          report.chi2_per_dof, report.workspace);
  }
  for (const std::string& warning : report.warnings) {
    absl::StrAppend(&text, "warning: ", warning, "\n");
  }
  return text;
}

}  // namespace silhouette
