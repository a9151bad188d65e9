// The figures of the report's page, as inline SVG.
#pragma once

#include <string>

#include "calib/report/quality_report.h"

namespace silhouette {

// A view's corners with their residuals as lines, held out where there are such; its image's fields
// by how many corners were seen there, and where the workspace is but none were; and by the error
// predicted for points of the workspace.
std::string ResidualFigure(const ReportView& view);
std::string CoverageFigure(const ReportView& view);
std::string PredictionFigure(const ReportView& view);

// All images, a row per view and a column per frame, by how well they fit.
std::string ImageFigure(const QualityReport& report);

}  // namespace silhouette
