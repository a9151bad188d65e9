// SPDX-License-Identifier: Apache-2.0
// What `intrinsics`, `poses`, `report` and `run` say and write.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/camera/epipolar_angles.h"
#include "calib/intrinsics/solve_lenses.h"
#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/quality_report.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/poses_inputs.h"

namespace silhouette {

std::string LensText(const LensSolution& solution, const std::vector<std::string>& files);
nlohmann::ordered_json LensJson(const LensSolution& solution,
                                const std::vector<std::string>& files);

// By the views' names.
using MaskSizes = std::map<std::string, PixelSize>;

MaskSizes MaskSizesOf(const Cell& cell);

// From the command line, empty if not given: a cell file, or WIDTHxHEIGHT for all views of the
// problem. InvalidArgument or NotFound in a sentence.
absl::StatusOr<MaskSizes> MaskSizesFrom(const std::string& cell, const std::string& size,
                                        const PoseProblem& problem);

// How well lenses are known, and the warnings about them, for calibration.yaml.
storage::v1::CalibrationRecord RecordOf(const LensSolution& solution);

struct PoseProvenance {
  std::string command;  // of silhouette-calibrate
  std::string lenses;   // where they are from
  MaskSizes masks;      // there are matrices if those of all views are known
  // Figures and warnings of what came before the poses.
  storage::v1::CalibrationRecord record = {};
};

// Whether any camera is in the base frame: only those are views of a cell.
bool HasViews(const PoseSolution& solution);

// The file beside the camera models in `folder`, which must be there: views, matrices, and how
// good they are by the solution, with what it warns of. HasViews(solution) must hold. Returns its
// path; errors as WriteWholeFile.
absl::StatusOr<std::string> WritePoseCalibration(const std::string& folder,
                                                 const PoseProblem& problem,
                                                 const PoseSolution& solution,
                                                 const PoseProvenance& provenance);

// Everything but the residuals of single corners. Millimetres and degrees have such names, all else
// is in metres and radians.
nlohmann::ordered_json PosesJson(const PoseSolution& solution);

std::string PosesText(const PoseSolution& solution);

// Camera models with their poses, calibration.yaml, poses.json and residuals.csv in `folder`, which
// is made. A camera on the flange has its pose there, and its file is called
// VIEW.flange.cameramodel, so that nobody takes it for one in the base; calibration.yaml is of the
// others. With `draw` residuals_VIEW.png too. Returns the files.
absl::StatusOr<std::vector<std::string>> WritePoses(const std::string& folder,
                                                    const PoseProblem& problem,
                                                    const PoseSolution& solution,
                                                    const PoseProvenance& provenance, bool draw);

// MakeReport over the workspace of WorkspacePointsOf; their errors.
absl::StatusOr<QualityReport> ReportOn(const PoseProblem& problem, const PoseSources& sources,
                                       const std::string& workspace_box = "", int groups = 8);

// The page, and the JSON; an empty name: not. Returns the files.
absl::StatusOr<std::vector<std::string>> WriteReport(const QualityReport& report,
                                                     const PoseSources& sources,
                                                     const std::string& page,
                                                     const std::string& json);

}  // namespace silhouette
