// Calibrations that each know nothing of a group of sightings.
#pragma once

#include <cstddef>
#include <vector>

#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/problem_parts.h"
#include "calib/report/quality_report.h"

namespace silhouette {

struct LeftOutPart {
  PoseSolution solution;
  std::vector<size_t> left_out;  // sightings
};

// One per group, but for those without which there is no calibration: of these `report` is warned.
// Fills what the report says of groups.
std::vector<LeftOutPart> SolveWithoutEach(const PoseProblem& problem, const SightingGroups& groups,
                                          QualityReport& report);

}  // namespace silhouette
