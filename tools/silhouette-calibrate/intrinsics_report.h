// What `silhouette-calibrate intrinsics` says.
#pragma once

#include <string>
#include <vector>

#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

std::string LensReportText(const LensSolution& solution, const std::vector<std::string>& files);
std::string LensReportJson(const LensSolution& solution, const std::vector<std::string>& files);

}  // namespace silhouette
