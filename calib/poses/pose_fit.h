// A problem brought near its minimum with the robot taken at its word: what everything else begins
// with, and by which guesses of what is wrong are compared.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_bundle.h"
#include "calib/poses/pose_network.h"

namespace silhouette {

struct PoseFit {
  PoseNetwork network;
  Bundle bundle;  // sizes and flanges are constant
  // Per view: the median length of a corner's residual, and what it should be by the sigmas stated.
  std::vector<double> median_px;
  std::vector<double> expected_px;
};

// Errors as those of CalibratePoses, except for what only a contradiction in the data shows.
absl::StatusOr<PoseFit> FitWithExactRobot(const PoseProblem& problem);

// Adjusts with corners that are far off counting less, from what the median is now down to
// `robust` sigmas. As Adjust.
bool AdjustStepwise(Bundle& bundle, double robust);

}  // namespace silhouette
