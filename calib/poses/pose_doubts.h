// What may be wrong where data do not fit together: each guess is tried, and believed only if the
// data fit far better with it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/poses/pose_fit.h"

namespace silhouette {

// FailedPrecondition, with the reason and the mend, if the fit is far from what the stated sigmas
// explain and a guess explains it - or nothing does.
absl::Status CheckFit(const PoseProblem& problem, const PoseFit& fit);

// FailedPrecondition if the robot's motion or the survey says that a board is of another size, by
// 1 % and more; by less it is a warning. `bundle`: at its minimum with the robot's noise.
absl::Status CheckSizes(const PoseNetwork& network, const Bundle& bundle,
                        std::vector<std::string>& warnings);

}  // namespace silhouette
