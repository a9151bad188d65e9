// Whether what a solve found can be relied on, in plain words.
#pragma once

#include "absl/status/status.h"
#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

// Fills in the statistics of each camera from residuals and covariances, and warnings.
// FailedPrecondition if a lens is known too badly, with what the images lack.
absl::Status JudgeLenses(const std::vector<LensCamera>& cameras, const LensSettings& settings,
                         LensSolution& solution);

}  // namespace silhouette
