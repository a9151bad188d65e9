// What is wrong with a problem before anything is solved.
#pragma once

#include "absl/status/status.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

// InvalidArgument: a name or a tag is there twice, a view is not there, a number is none or not
// positive. FailedPrecondition: nothing was seen, positions in millimetres, mirrored images.
absl::Status CheckProblem(const PoseProblem& problem);

}  // namespace silhouette
