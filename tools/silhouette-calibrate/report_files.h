// What `silhouette-calibrate report` says and writes.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/report/quality_report.h"
#include "tools/silhouette-calibrate/poses_inputs.h"

namespace silhouette {

// As MakeReport, over the workspace that WorkspacePointsOf tells; their errors.
absl::StatusOr<QualityReport> ReportOn(const PoseProblem& problem, const PoseSources& sources,
                                       const std::string& workspace_box = "", int groups = 8);

void PrintReport(const QualityReport& report);

// The page, and the JSON; an empty name: not. Returns the files.
absl::StatusOr<std::vector<std::string>> WriteReport(const QualityReport& report,
                                                     const PoseSources& sources,
                                                     const std::string& page,
                                                     const std::string& json);

}  // namespace silhouette
