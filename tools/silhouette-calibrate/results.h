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
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_problem.h"
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

// CalibratePoses, saying on stderr what it does.
absl::StatusOr<PoseSolution> CalibratePosesInSteps(PoseProblem problem);

// How well lenses are known, and the warnings about them, for calibration.yaml.
storage::v1::CalibrationRecord RecordOf(const LensSolution& solution);

struct PoseProvenance {
  std::string command;  // of silhouette-calibrate
  std::string lenses;   // folder of their camera models
  MaskSizes masks;      // matrices are written if the sizes of all views are known
  // Figures and warnings of the lenses.
  storage::v1::CalibrationRecord record = {};
};

// Whether any camera is in the base frame: only those are views of a cell.
bool HasViews(const PoseSolution& solution);

// Writes calibration.yaml beside the camera models in `folder`, which must exist: views, matrices,
// figures of merit and warnings of the solution. HasViews(solution) must hold. Returns the path;
// errors as WriteWholeFile.
absl::StatusOr<std::string> WritePoseCalibration(const std::string& folder,
                                                 const PoseProblem& problem,
                                                 const PoseSolution& solution,
                                                 const PoseProvenance& provenance);

// Everything but the residuals of single corners, and of pairs of poses nothing of corners.
// Millimetres and degrees have such names, all else is in metres and radians.
nlohmann::ordered_json PosesJson(const PoseSolution& solution);

std::string PosesText(const PoseSolution& solution);

// Writes camera models with their poses, calibration.yaml, poses.json and residuals.csv into
// `folder`, which it makes. A camera on the flange has its pose in the flange's frame. Its file is
// named VIEW.flange.cameramodel, and calibration.yaml does not contain it. `draw` adds
// residuals_VIEW.png. Existing files stay until all new ones are written. If the program is killed
// meanwhile, cameras of two calibrations never import as one. Returns the files.
absl::StatusOr<std::vector<std::string>> WritePoses(const std::string& folder,
                                                    const PoseProblem& problem,
                                                    const PoseSolution& solution,
                                                    const PoseProvenance& provenance, bool draw);

// What is said of a report that IsStable refuses, where it has neither refusal nor doubts.
inline constexpr char kNotStable[] =
    "the calibration is not stable: other frames give another, as the report's warnings say; mend "
    "what they name, or add frames";

// MakeReport over the workspace of WorkspacePointsOf, saying on stderr what it does; their errors.
absl::StatusOr<QualityReport> ReportOn(PoseProblem problem, const PoseSources& sources,
                                       const std::string& workspace_box = "", int groups = 8);

// The page, and the JSON; an empty name: not. Returns the files.
absl::StatusOr<std::vector<std::string>> WriteReport(const QualityReport& report,
                                                     const PoseSources& sources,
                                                     const std::string& page,
                                                     const std::string& json);

}  // namespace silhouette
