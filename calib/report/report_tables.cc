#include "calib/report/report_tables.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/report/html_text.h"
#include "calib/report/report_judgement.h"
#include "common/page/page.h"

namespace silhouette {
namespace {

constexpr char kNone[] = "<span class=\"soft\">&ndash;</span>";

std::string Dot(Grade grade) {
  return absl::StrFormat("<i class=\"dot %s\" title=\"%s\"></i>", NameOf(grade), NameOf(grade));
}

std::string Cell(const std::string& html) { return absl::StrCat("<td>", html, "</td>"); }

std::string Tile(const std::string& name, Grade grade, const std::string& value,
                 const std::string& unit, const std::string& more) {
  return absl::StrFormat(
      "<div class=\"tile %s\"><div class=\"name\">%s</div><div class=\"value\">%s "
      "<small>%s</small></div><div class=\"more\">%s</div></div>\n",
      NameOf(grade), name, value, unit, more);
}

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

std::string HeldOutTile(const QualityReport& report) {
  const ReportView* view = Worst(
      report, [](const ReportView& v) { return GradeOf(v.held_out); },
      [](const ReportView& v) { return v.held_out.corners > 0 ? v.held_out.px : 0; });
  if (view == nullptr) return Tile("Held-out corners", Grade::kUnknown, "&ndash;", "", "not known");
  return Tile("Held-out corners", GradeOf(view->held_out), PixelText(view->held_out.px), "px",
              absl::StrCat("worst view, ", Escaped(view->name), "; expected ",
                           PixelText(view->held_out.expected_px)));
}

std::string LineTile(const QualityReport& report) {
  const auto worst = std::max_element(
      report.pairs.begin(), report.pairs.end(), [&](const ReportPair& x, const ReportPair& y) {
        return std::pair(GradeOfLines(x, report), x.px) < std::pair(GradeOfLines(y, report), y.px);
      });
  if (worst == report.pairs.end() || worst->corners == 0) {
    return Tile("Epipolar lines, held out", Grade::kUnknown, "&ndash;", "",
                "no corners seen by two views");
  }
  return Tile("Epipolar lines, held out", GradeOfLines(*worst, report), PixelText(worst->px), "px",
              absl::StrCat("worst pair, ", Escaped(worst->view_a), " - ", Escaped(worst->view_b)));
}

std::string PredictionTile(const QualityReport& report) {
  const ReportView* view = Worst(
      report, [](const ReportView& v) { return GradeOf(v.predicted, v.width); },
      [](const ReportView& v) { return v.predicted.px; });
  if (view == nullptr) {
    return Tile("Predicted, workspace", Grade::kUnknown, "&ndash;", "", "not known");
  }
  return Tile("Predicted, workspace", GradeOf(view->predicted, view->width),
              PixelText(view->predicted.px), "px",
              absl::StrFormat("worst view, %s; %.2f mm", Escaped(view->name), view->predicted.mm));
}

std::string RepeatabilityTile(const QualityReport& report) {
  const ReportView* view = Worst(
      report, [](const ReportView& v) { return GradeOf(*v.repeatability, v.predicted); },
      [](const ReportView& v) { return v.repeatability ? v.repeatability->px : 0; });
  if (view == nullptr) return Tile("Repeatability", Grade::kUnknown, "&ndash;", "", "not known");
  return Tile("Repeatability", GradeOf(*view->repeatability, view->predicted),
              PixelText(view->repeatability->px), "px",
              absl::StrFormat("worst view, %s; %.2f mm, %.3f&deg;", Escaped(view->name),
                              view->repeatability->mm, view->repeatability->deg));
}

std::string HeldOutText(const HeldOutError& error) {
  if (error.corners == 0) return kNone;
  return absl::StrFormat("%s%s <small>(%s)</small>", Dot(GradeOf(error)), PixelText(error.px),
                         PixelText(error.expected_px));
}

std::string PredictedText(const ReportView& view) {
  if (view.predicted.points == 0) return kNone;
  return absl::StrFormat("%s%s <small>(%s)</small>", Dot(GradeOf(view.predicted, view.width)),
                         PixelText(view.predicted.px), PixelText(view.predicted.worst_px));
}

std::string RepeatabilityText(const ReportView& view) {
  if (!view.repeatability) return kNone;
  return absl::StrFormat(
      "%s%s <small>%.2f mm %.3f&deg;</small>", Dot(GradeOf(*view.repeatability, view.predicted)),
      PixelText(view.repeatability->px), view.repeatability->mm, view.repeatability->deg);
}

std::string HalvesText(const ReportView& view) {
  if (!view.halves) return kNone;
  return absl::StrFormat("%s%s <small>(%s)</small>", Dot(GradeOf(*view.halves)),
                         PixelText(view.halves->px), PixelText(view.halves->expected_px));
}

std::string TiltText(const ReportView& view) {
  if (!view.tilt_deg) return kNone;
  return absl::StrFormat("%s%.0f&deg;", Dot(GradeOfTilt(view)), *view.tilt_deg);
}

std::string ReachText(const ReportView& view, bool solved) {
  if (!solved) return absl::StrFormat("%.0f %%", 100 * view.coverage);
  if (view.predicted.points == 0) return kNone;
  return absl::StrFormat("%s%.0f %%", Dot(GradeOfCoverage(view)), 100 * view.reached);
}

}  // namespace

std::string SummaryTiles(const QualityReport& report) {
  return absl::StrCat(
      "<div class=\"tiles\">\n", HeldOutTile(report), LineTile(report), PredictionTile(report),
      RepeatabilityTile(report),
      Tile("&chi;&sup2; per degree of freedom", GradeOfChi2(report.chi2_per_dof),
           absl::StrFormat("%.2f", report.chi2_per_dof), "",
           absl::StrFormat("1 if sigmas are right; %d degrees of freedom", report.dof)),
      "</div>\n");
}

std::string ViewTable(const QualityReport& report) {
  const bool solved = report.refusal.empty();
  std::string html = absl::StrCat(
      "<table>\n<tr><th>view</th><th>frames</th><th>corners<br>(left out)</th><th>tilts</th><th>",
      solved ? "workspace<br>covered" : "image<br>covered", "</th>");
  if (solved) {
    absl::StrAppend(&html,
                    "<th>fit<br>px</th><th>held out<br>px (expected)</th><th>predicted<br>px "
                    "(worst)</th><th>predicted<br>mm</th><th>repeatability<br>px</th><th>halves<br>"
                    "px (expected)</th>");
  }
  absl::StrAppend(&html, "</tr>\n");
  for (const ReportView& view : report.views) {
    absl::StrAppend(
        &html, "<tr>",
        Cell(absl::StrCat(solved ? Dot(GradeOf(view)) : "", "<b>", Escaped(view.name), "</b>",
                          view.on_flange ? " <small>on the flange</small>" : "")),
        Cell(absl::StrCat(view.frames)),
        Cell(absl::StrFormat("%d <small>(%d)</small>", view.corners, view.outliers)),
        Cell(TiltText(view)), Cell(ReachText(view, solved)));
    if (solved) {
      absl::StrAppend(&html, Cell(PixelText(view.fit_px)), Cell(HeldOutText(view.held_out)),
                      Cell(PredictedText(view)), Cell(absl::StrFormat("%.2f", view.predicted.mm)),
                      Cell(RepeatabilityText(view)), Cell(HalvesText(view)));
    }
    absl::StrAppend(&html, "</tr>\n");
  }
  return absl::StrCat(html, "</table>\n");
}

std::string PairTable(const QualityReport& report) {
  std::string html =
      "<table class=\"narrow\">\n<tr><th>pair</th><th>seen at once</th><th>held-out corners</th>"
      "<th>rms px</th><th>median px</th><th>worst px</th></tr>\n";
  for (const ReportPair& pair : report.pairs) {
    const bool known = pair.corners > 0;
    const auto number = [&](double px) { return Cell(known ? PixelText(px) : kNone); };
    absl::StrAppend(&html, "<tr>",
                    Cell(absl::StrCat(Dot(GradeOfLines(pair, report)), Escaped(pair.view_a), " - ",
                                      Escaped(pair.view_b))),
                    Cell(absl::StrCat(pair.seen)), Cell(absl::StrCat(pair.corners)),
                    number(pair.px), number(pair.median_px), number(pair.worst_px), "</tr>\n");
  }
  return absl::StrCat(html, "</table>\n");
}

std::string ImageTable(const QualityReport& report) {
  constexpr size_t kMost = 15;
  const auto excess = [](const ReportImage& image) {
    const HeldOutError& error = image.held_out;
    return 100 * image.outliers + (error.expected_px > 0 ? error.px / error.expected_px : 0);
  };
  std::vector<ReportImage> worst;
  for (const ReportImage& image : report.images) {
    if (image.outliers > 0 || GradeOf(image.held_out) == Grade::kBad) worst.push_back(image);
  }
  if (worst.empty()) return "";
  std::stable_sort(worst.begin(), worst.end(), [&](const ReportImage& a, const ReportImage& b) {
    return excess(a) > excess(b);
  });
  std::string html =
      "<table class=\"narrow\">\n<tr><th>image</th><th>view</th><th>corners</th><th>left out</th>"
      "<th>fit px</th><th>held out px (expected)</th></tr>\n";
  for (size_t i = 0; i < std::min(kMost, worst.size()); ++i) {
    const ReportImage& image = worst[i];
    absl::StrAppend(&html, "<tr>", Cell(Escaped(image.frame)), Cell(Escaped(image.view)),
                    Cell(absl::StrCat(image.corners)), Cell(absl::StrCat(image.outliers)),
                    Cell(PixelText(image.fit_px)), Cell(HeldOutText(image.held_out)), "</tr>\n");
  }
  absl::StrAppend(&html, "</table>\n");
  if (worst.size() > kMost) {
    absl::StrAppendFormat(&html, "<p class=\"soft\">and %d more</p>\n", worst.size() - kMost);
  }
  return html;
}

}  // namespace silhouette
