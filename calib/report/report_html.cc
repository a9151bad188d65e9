#include "calib/report/report_html.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/report/report_figures.h"
#include "calib/report/report_judgement.h"
#include "calib/report/report_tables.h"
#include "common/page/page.h"

namespace silhouette {
namespace {

std::string Verdict(const QualityReport& report) {
  const size_t warnings = report.warnings.size();
  std::string says = "Nothing to warn of";
  if (!report.refusal.empty()) {
    says = absl::StrCat("No calibration: ", Escaped(report.refusal));
  } else if (warnings > 0) {
    says = warnings == 1 ? "One warning" : absl::StrCat(warnings, " warnings");
  }
  std::string html = absl::StrFormat("<div class=\"verdict %s\"><strong>%s</strong>\n",
                                     NameOf(GradeOf(report)), says);
  if (warnings > 0) {
    absl::StrAppend(&html, "<ul>\n");
    for (const std::string& warning : report.warnings) {
      absl::StrAppend(&html, "<li>", Escaped(warning), "</li>\n");
    }
    absl::StrAppend(&html, "</ul>\n");
  }
  return absl::StrCat(html, "</div>\n");
}

std::string Figure(const std::string& caption, const std::string& svg) {
  if (svg.empty()) return "";
  return absl::StrCat("<figure><figcaption>", caption, "</figcaption>\n", svg, "</figure>\n");
}

std::string ViewCard(const ReportView& view) {
  return absl::StrCat(
      absl::StrFormat("<div class=\"card\"><h3><i class=\"dot %s\"></i>%s <small class=\"soft\">%d "
                      "x %d pixels</small></h3>\n<div class=\"maps\">\n",
                      NameOf(GradeOf(view)), Escaped(view.name), view.width, view.height),
      Figure(view.held_out.corners > 0 ? "Residuals of held-out corners" : "Residuals of the fit",
             ResidualFigure(view)),
      Figure("Where corners were seen", CoverageFigure(view)),
      Figure("Predicted error of points of the workspace", PredictionFigure(view)),
      "</div></div>\n");
}

// What can be shown where there is no calibration.
std::string CoverageCard(const QualityReport& report) {
  std::string html = "<div class=\"card\"><h3>Where corners were seen</h3>\n<div class=\"maps\">\n";
  for (const ReportView& view : report.views) {
    absl::StrAppend(&html, Figure(Escaped(view.name), CoverageFigure(view)));
  }
  return absl::StrCat(html, "</div></div>\n");
}

std::string ImagesCard(const QualityReport& report) {
  const std::string table = ImageTable(report);
  return absl::StrCat(
      "<h2>Images</h2>\n<p class=\"soft\">By how far held-out corners are off, against what was to "
      "be expected of them.</p>\n<div class=\"card\">\n",
      ImageFigure(report),
      "<div class=\"key\"><span><i style=\"background:#9fd3ba\"></i>as expected</span><span><i "
      "style=\"background:#f0c568\"></i>more than 1.4 times that</span><span><i "
      "style=\"background:#e58a63\"></i>more than twice</span><span><i "
      "style=\"background:#d5dade\"></i>nothing to compare with</span><span>&#9679; corners or "
      "pose left out</span></div>\n</div>\n",
      table.empty() ? ""
                    : absl::StrCat("<div class=\"card\"><h3>Images that stand out</h3>\n", table,
                                   "</div>\n"));
}

std::string Meanings(const QualityReport& report) {
  const bool by_frames = report.held_out_by == HeldOutBy::kFrames;
  return absl::StrCat(
      "<h2>What the figures mean</h2>\n<div class=\"card\"><dl>\n"
      "<dt>Held out</dt><dd>",
      report.held_out_by == HeldOutBy::kNothing
          ? "Nothing could be held out."
          : absl::StrFormat(
                "The calibration was made %d times, each time without another group of %s; what "
                "these show is compared with where it says they should appear. Where the board was "
                "is taken from the robot, the survey and the other views. Expected: what the "
                "sigmas of corners, robot, survey and camera explain.",
                report.groups, by_frames ? "frames" : "boards"),
      " The lines in the maps lead from where corners were seen to where they should be; red: left "
      "out.</dd>\n<dt>Epipolar lines</dt><dd>Distances, in both images, of held-out corners that "
      "two "
      "views saw at once from the lines that the cameras give; in undistorted pixels.</dd>\n"
      "<dt>Predicted</dt><dd>Standard deviation of where points of the workspace appear, by the "
      "normal equations of the solve, and of where they are in millimetres. The camera's pose "
      "alone is uncertain in it: the lens is taken as it was given. Workspace: ",
      Escaped(report.workspace),
      ".</dd>\n<dt>Repeatability</dt><dd>By how much another session of this kind would move "
      "points "
      "of the workspace, the camera's centre and its direction: the jackknife's standard error, "
      "each group left out once. It should be near what is predicted.</dd>\n"
      "<dt>Halves</dt><dd>The calibration of the first half of the frames against that of the "
      "second, in points of the workspace. More than twice what is expected: something "
      "moved.</dd>\n"
      "<dt>Tilts</dt><dd>How far the boards' normals spread about the axis about which they turned "
      "least; 10&deg; and more are good.</dd>\n"
      "<dt>&chi;&sup2; per degree of freedom</dt><dd>",
      absl::StrFormat("Of all residuals by the stated sigmas. Corners look %.2f times as noisy as "
                      "stated",
                      report.image_noise_factor),
      report.robot_noise_factor > 0
          ? absl::StrFormat(", the robot %.2f times", report.robot_noise_factor)
          : "",
      report.survey_noise_factor > 0
          ? absl::StrFormat(", the survey %.2f times", report.survey_noise_factor)
          : "",
      ". Pixels are root mean squares per axis, those of epipolar lines of distances.</dd>\n"
      "</dl></div>\n");
}

}  // namespace

std::string ReportHtml(const QualityReport& report,
                       const std::vector<std::pair<std::string, std::string>>& origin) {
  const bool solved = report.refusal.empty();
  std::string html = Verdict(report);
  if (solved) absl::StrAppend(&html, SummaryTiles(report));
  absl::StrAppend(&html, "<h2>Cameras</h2>\n<div class=\"card\">\n", ViewTable(report), "</div>\n");
  if (!solved) return Page("Calibration report", origin, html + CoverageCard(report));
  for (const ReportView& view : report.views) absl::StrAppend(&html, ViewCard(view));
  if (!report.pairs.empty()) {
    absl::StrAppend(&html, "<h2>Epipolar lines</h2>\n<div class=\"card\">\n", PairTable(report),
                    "</div>\n");
  }
  absl::StrAppend(&html, ImagesCard(report), Meanings(report));
  return Page("Calibration report", origin, html);
}

}  // namespace silhouette
