// A solved bundle as a PoseSolution.
#pragma once

#include "calib/poses/pose_bundle.h"
#include "calib/poses/pose_fit.h"
#include "calib/poses/pose_solution.h"

namespace silhouette {

// How many times the stated sigmas the errors are.
struct NoiseFactors {
  double image = 0;
  double robot = 0;         // 0: not known
  double survey = 0;        // 0: not known
  double chi2_per_dof = 0;  // with the sigmas as stated
};

// The bundle's covariances must have been found.
PoseSolution SolutionOf(const PoseFit& fit, const BundleStatistics& statistics,
                        const NoiseFactors& factors);

}  // namespace silhouette
