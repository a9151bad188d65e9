// SPDX-License-Identifier: Apache-2.0
// A problem brought near its minimum with the robot taken at its word: what everything else begins
// with, and by which guesses of what is wrong are compared.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/poses/pose_bundle.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_network.h"

namespace silhouette {

struct PoseFit {
  PoseNetwork network;
  Bundle bundle;  // sizes and flanges are constant
  // Per view: the median length of a corner's residual, and what it should be by the sigmas stated.
  std::vector<double> median_px;
  std::vector<double> expected_px;
};

// A corner of a look; its board's pose and size are to be set where they differ from the network's.
BundleCorner CornerOf(const PoseNetwork& network, size_t look, size_t place);

// Errors as those of CalibratePoses, except for what only a contradiction in the data shows.
absl::StatusOr<PoseFit> FitWithExactRobot(const PoseProblem& problem);

// Of AdjustStepwise, in sigmas: from here on a corner loses its pull.
inline constexpr double kRobust = 3;

// Adjusts with corners that are far off counting less, from what the median is now down to
// `robust` sigmas. As Adjust.
bool AdjustStepwise(Bundle& bundle, double robust);

// Single corners, poses of the robot and surveyed places that do not fit the rest.

// Marks again what is too far off (BundleCorner::used, BundlePose::left_out), measured by how far
// off its like is. Returns whether anything changed.
bool MarkOutliers(Bundle& bundle);

// FailedPrecondition if so much was left out that nothing can be called the rest.
absl::Status CheckOutliers(const Bundle& bundle);

// What may be wrong where data do not fit together: each guess is tried, and believed only if the
// data fit far better with it.

// FailedPrecondition, with the reason and the mend, if the fit is far from what the stated sigmas
// explain and a guess explains it - or nothing does.
absl::Status CheckFit(const PoseProblem& problem, const PoseFit& fit);

// FailedPrecondition if the robot's motion or the survey says that a board is of another size, by
// 1 % and more; by less it is a warning. `bundle`: at its minimum with the robot's noise.
absl::Status CheckSizes(const PoseNetwork& network, const Bundle& bundle,
                        std::vector<std::string>& warnings);

// A solved bundle as a PoseSolution.

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
