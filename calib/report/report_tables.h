// The numbers of the report's page.
#pragma once

#include <string>

#include "calib/report/quality_report.h"

namespace silhouette {

std::string SummaryTiles(const QualityReport& report);
std::string ViewTable(const QualityReport& report);
std::string PairTable(const QualityReport& report);
// The images that stand out; empty if none does.
std::string ImageTable(const QualityReport& report);

}  // namespace silhouette
