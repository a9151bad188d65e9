// SPDX-License-Identifier: Apache-2.0
// A report for people, as a page, and for programs, as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "calib/report/quality_report.h"

namespace silhouette {

// One HTML page that needs no other file, no network and no script; made by report.html. `origin`:
// where the data come from, names and values.
std::string ReportHtml(const QualityReport& report,
                       const std::vector<std::pair<std::string, std::string>>& origin);

// Complete but for the single corners. Unknown values are null. Names end in their unit.
nlohmann::ordered_json ReportJson(const QualityReport& report);

// The same values as a table, warnings and all, for a terminal.
std::string ReportText(const QualityReport& report);

// The figures of the page, as inline SVG. A view's corners with their residuals as lines, held out
// where there are such; its image's fields by how many corners were seen there, and where the
// workspace is but none were; and by the error predicted for points of the workspace, empty if none
// is known.
std::string ResidualFigure(const ReportView& view);
std::string CoverageFigure(const ReportView& view);
std::string PredictionFigure(const ReportView& view);
// All images, a row per view and a column per frame, by how well they fit.
std::string ImageFigure(const QualityReport& report);

// A length in pixels with three decimals, two where it is 1 and more.
std::string PixelText(double px);

}  // namespace silhouette
