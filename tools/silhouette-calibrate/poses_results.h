// What `silhouette-calibrate poses` says and writes.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "tools/silhouette-calibrate/poses_calibration.h"

namespace silhouette {

// Everything but the residuals of single corners. Millimetres and degrees have such names, all else
// is in metres and radians.
nlohmann::ordered_json PosesJson(const PoseSolution& solution);

void PrintPoses(const PoseSolution& solution);

// Camera models with their poses, calibration.yaml, poses.json and residuals.csv in `folder`, which
// is made. A camera on the flange has its pose there, and its file is called
// VIEW.flange.cameramodel, so that nobody takes it for one in the base; calibration.yaml is of the
// others. With `draw` residuals_VIEW.png too. Returns the files.
absl::StatusOr<std::vector<std::string>> WritePoses(const std::string& folder,
                                                    const PoseProblem& problem,
                                                    const PoseSolution& solution,
                                                    const PoseProvenance& provenance, bool draw);

}  // namespace silhouette
