#include "tools/silhouette-calibrate/report_files.h"

#include <iostream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/report/make_report.h"
#include "calib/report/report_html.h"
#include "calib/report/report_json.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-calibrate/report_workspace.h"

namespace silhouette {
namespace {

std::vector<std::pair<std::string, std::string>> OriginOf(const PoseSources& sources) {
  std::vector<std::pair<std::string, std::string>> origin = {
      {"made", absl::FormatTime("%Y-%m-%d %H:%M UTC", absl::Now(), absl::UTCTimeZone())}};
  const auto add = [&](const std::string& name, const std::string& value) {
    if (!value.empty()) origin.emplace_back(name, value);
  };
  add("corners", sources.corners);
  add("boards", sources.boards);
  add("lenses", sources.cameras);
  add("robot poses", sources.robot_poses);
  add("joint values", sources.joints);
  add("survey", sources.survey);
  return origin;
}

std::string HeldOutText(const HeldOutError& error) {
  if (error.corners == 0) return "-";
  return absl::StrFormat("%.3f (%.3f)", error.px, error.expected_px);
}

}  // namespace

absl::StatusOr<QualityReport> ReportOn(const PoseProblem& problem, const PoseSources& sources,
                                       const std::string& workspace_box, int groups) {
  ASSIGN_OR_RETURN(WorkspacePoints workspace, WorkspacePointsOf(sources, workspace_box));
  return MakeReport(problem, {.workspace = std::move(workspace.points),
                              .workspace_name = std::move(workspace.name),
                              .groups = groups});
}

void PrintReport(const QualityReport& report) {
  if (report.refusal.empty()) {
    std::cout << absl::StrFormat("%-14s %8s %8s %16s %18s %14s %16s\n", "view", "corners", "fit px",
                                 "held out (exp.)", "predicted (worst)", "repeatability",
                                 "halves (exp.)");
    for (const ReportView& view : report.views) {
      std::cout << absl::StrFormat(
          "%-14s %8d %8.3f %16s %18s %14s %16s\n", view.name, view.corners, view.fit_px,
          HeldOutText(view.held_out),
          absl::StrFormat("%.3f (%.3f)", view.predicted.px, view.predicted.worst_px),
          view.repeatability ? absl::StrFormat("%.3f", view.repeatability->px) : "-",
          view.halves ? absl::StrFormat("%.3f (%.3f)", view.halves->px, view.halves->expected_px)
                      : "-");
    }
    for (const ReportPair& pair : report.pairs) {
      if (pair.corners == 0) continue;
      std::cout << absl::StrFormat("%s - %s: %d held-out corners, %.3f px from their lines\n",
                                   pair.view_a, pair.view_b, pair.corners, pair.px);
    }
    std::cout << absl::StrFormat("chi2/dof %.2f; all in pixels; workspace: %s\n",
                                 report.chi2_per_dof, report.workspace);
  }
  for (const std::string& warning : report.warnings) std::cout << "warning: " << warning << '\n';
}

absl::StatusOr<std::vector<std::string>> WriteReport(const QualityReport& report,
                                                     const PoseSources& sources,
                                                     const std::string& page,
                                                     const std::string& json) {
  std::vector<std::string> files;
  if (!page.empty()) {
    RETURN_IF_ERROR(WriteWholeFile(page, ReportHtml(report, OriginOf(sources))));
    files.push_back(page);
  }
  if (!json.empty()) {
    RETURN_IF_ERROR(WriteWholeFile(json, ReportJson(report).dump(2) + "\n"));
    files.push_back(json);
  }
  return files;
}

}  // namespace silhouette
