// SPDX-License-Identifier: Apache-2.0
// Judges a calibration of poses: solves with all that is known, and again without parts of it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/quality_report.h"

namespace silhouette {

struct ReportSettings {
  // Points of the robot's workspace in the base, metres, and what they are in words. None: the
  // space in which boards were seen.
  std::vector<Eigen::Vector3d> workspace;
  std::string workspace_name;
  int groups = 8;  // of frames, left out one at a time; at least 2
};

// What CalibratePoses refuses with FailedPrecondition becomes the report's refusal, beside what can
// be said all the same. InvalidArgument as CalibratePoses, and for fewer than two groups.
absl::StatusOr<QualityReport> MakeReport(const PoseProblem& problem,
                                         const ReportSettings& settings = {});

}  // namespace silhouette
