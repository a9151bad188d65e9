// A report as JSON, complete but for the single corners.
#pragma once

#include <nlohmann/json.hpp>

#include "calib/report/quality_report.h"

namespace silhouette {

// What is not known is null. Names end in their unit.
nlohmann::ordered_json ReportJson(const QualityReport& report);

}  // namespace silhouette
