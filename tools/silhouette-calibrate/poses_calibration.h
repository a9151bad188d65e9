// calibration.yaml of cameras whose poses `silhouette-calibrate poses` or `run` has found.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/camera/epipolar_angles.h"
#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"

namespace silhouette {

// By the views' names.
using MaskSizes = std::map<std::string, PixelSize>;

MaskSizes MaskSizesOf(const Cell& cell);

// Of what is given on a command line, where empty is not given: the file of a cell, or WIDTHxHEIGHT
// for all views of the problem. InvalidArgument or NotFound in a sentence.
absl::StatusOr<MaskSizes> MaskSizesFrom(const std::string& cell, const std::string& size,
                                        const PoseProblem& problem);

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

}  // namespace silhouette
