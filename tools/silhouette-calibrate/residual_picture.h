// Where a view saw corners, and by how much they are off.
#pragma once

#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "common/picture/picture.h"

namespace silhouette {

// `view`: index in the problem and the solution.
Picture ResidualPicture(const PoseProblem& problem, const PoseSolution& solution, size_t view);

}  // namespace silhouette
