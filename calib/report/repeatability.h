// How much cameras differ between calibrations of the same cell.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/quality_report.h"

namespace silhouette {

// `points`: of the workspace, in the image of the view. `parts`: solutions without a group each, at
// least two.
Repeatability JackknifeOf(const PoseProblem& problem, size_t view,
                          const std::vector<Eigen::Vector3d>& points,
                          const std::vector<PoseSolution>& parts);

// Of two solutions that have no frame in common.
HalvesDifference DifferenceOf(const PoseProblem& problem, size_t view,
                              const std::vector<Eigen::Vector3d>& points, const PoseSolution& a,
                              const PoseSolution& b);

}  // namespace silhouette
