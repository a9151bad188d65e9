// Solving for lenses step by step, so that rough seeds suffice; corners that do not fit left out.
#pragma once

#include "absl/status/status.h"
#include "calib/intrinsics/lens_problem.h"
#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

// The intrinsics of a lens without distortion.
std::vector<double> PlainLens(int parameters, double focal_length, const Eigen::Vector2d& centre);

// From rough poses and focal lengths to lenses; robust rather than exact. Internal if mrcal fails.
absl::Status SolveRoughly(LensProblem& problem);

// What the last step of SolveExactly leaves free.
FreeParts LastStep(const LensProblem& problem, bool fixed_lenses, bool warp);

// From good seeds to the optimum. Weights of outliers become kOutlier: residuals longer than
// settings.outlier_sigmas times the larger of the camera's own noise (told by the median) and
// `sigma`, the standard deviation of a corner of weight 1. Internal if mrcal fails.
absl::Status SolveExactly(LensProblem& problem, bool fixed_lenses, bool warp, double sigma,
                          const LensSettings& settings);

// The median length of an observation's residuals, weighted; 0 without corners.
std::vector<double> MedianResiduals(const LensProblem& problem);

}  // namespace silhouette
