#include "tools/silhouette-calibrate/report_files.h"

#include <iostream>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/report/make_report.h"
#include "calib/report/report_page.h"
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

}  // namespace

absl::StatusOr<QualityReport> ReportOn(const PoseProblem& problem, const PoseSources& sources,
                                       const std::string& workspace_box, int groups) {
  ASSIGN_OR_RETURN(WorkspacePoints workspace, WorkspacePointsOf(sources, workspace_box));
  return MakeReport(problem, {.workspace = std::move(workspace.points),
                              .workspace_name = std::move(workspace.name),
                              .groups = groups});
}

void PrintReport(const QualityReport& report) { std::cout << ReportText(report); }

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
