// A report as one HTML page that needs no other file, no network and no script.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "calib/report/quality_report.h"

namespace silhouette {

// `origin`: what the page says of where the data come from, names and values.
std::string ReportHtml(const QualityReport& report,
                       const std::vector<std::pair<std::string, std::string>>& origin);

}  // namespace silhouette
