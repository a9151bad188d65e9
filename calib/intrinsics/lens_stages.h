// SPDX-License-Identifier: Apache-2.0
// Solving for lenses step by step, so that rough seeds suffice; corners that do not fit left out.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/intrinsics/board_views.h"
#include "calib/intrinsics/lens_problem.h"
#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

// The intrinsics of a lens without distortion.
std::vector<double> PlainLens(int parameters, double focal_length, const Eigen::Vector2d& centre);

// From rough poses and focal lengths to lenses; robust rather than exact. Internal if mrcal fails.
absl::Status SolveRoughly(LensProblem& problem);

// What the last step of SolveExactly leaves free.
FreeParts LastStep(const LensProblem& problem, bool fixed_lenses, bool warp);

// From good seeds to the optimum. Weights of outliers become kOutlier: residuals longer than
// settings.outlier_sigmas times the larger of the camera's own noise (from the median) and
// `sigma`, the standard deviation of a corner of weight 1. Internal if mrcal fails.
absl::Status SolveExactly(LensProblem& problem, bool fixed_lenses, bool warp, double sigma,
                          const LensSettings& settings);

// The median length of an observation's residuals, weighted; 0 without corners.
std::vector<double> MedianResiduals(const LensProblem& problem);

// Where a solve starts from: rough focal lengths and the poses of boards before their cameras.

// Of board views' corners, seen by a camera without distortion, of that focal length and with the
// principal point `centre`: how the board stood. Nothing if the corners are those of no board.
std::optional<Eigen::Isometry3d> CameraFromBoard(const std::vector<Eigen::Vector3d>& corners,
                                                 const Lattice& lattice, double focal_length,
                                                 const Eigen::Vector2d& centre);

// The focal length, out of a range that goes by the image's size, with which the views are nearest
// to those of boards.
double GuessFocalLength(const std::vector<const BoardView*>& views, const Lattice& lattice,
                        int width, int height);

// One camera by itself: roughly its lens, the poses of the boards it saw, and which of its images
// do not fit the others.

struct SingleCamera {
  std::vector<double> intrinsics;
  std::vector<PosedView> views;  // without those that do not fit
  std::vector<std::string> warnings;
};

// The lens model of a solve: that of the settings, or that of CameraIntrinsics if they are fixed.
std::string LensModelOf(const LensCamera& camera, const LensSettings& settings);

// InvalidArgument: too many images do not fit. FailedPrecondition: too few images. Internal: mrcal
// failed.
absl::StatusOr<SingleCamera> SolveAlone(const LensCamera& camera,
                                        const std::vector<const BoardView*>& views,
                                        const Lattice& lattice, const LensSettings& settings);

// Whether what a solve found can be relied on, in plain words.

// Fills in the statistics of each camera from residuals and covariances, and warnings.
// FailedPrecondition if a lens is known too badly, with what the images lack.
absl::Status JudgeLenses(const std::vector<LensCamera>& cameras, const LensSettings& settings,
                         LensSolution& solution);

}  // namespace silhouette
