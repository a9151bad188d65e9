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

// Corners whose residuals are longer than `sigmas` times the noise are left out: the noise of their
// camera (from the median) or, with `by_part` and if larger, that of the corners in that part of
// the image. The sightings' own sigmas only weigh them against each other.
struct OutlierRule {
  double sigmas = 0;
  bool by_part = false;
};
// For the result. At rims lens models fit worse, and few corners say what the lens is there.
inline constexpr OutlierRule kResultRule{.sigmas = 6, .by_part = true};
// For the judgement: what is left out speaks against the lens.
inline constexpr OutlierRule kJudgementRule{.sigmas = 4.5, .by_part = false};

// From good seeds to the optimum. Weights of outliers become kOutlier. Internal if mrcal fails.
absl::Status SolveExactly(LensProblem& problem, bool fixed_lenses, bool warp,
                          const OutlierRule& rule);

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

// Of the corners of all views, as the sightings state it.
double MedianSigma(const std::vector<PosedView>& views);

// The lens model of a solve: that of the settings, or that of CameraIntrinsics if they are fixed.
std::string LensModelOf(const LensCamera& camera, const LensSettings& settings);

// InvalidArgument: too many images do not fit. FailedPrecondition: too few images. Internal: mrcal
// failed.
absl::StatusOr<SingleCamera> SolveAlone(const LensCamera& camera,
                                        const std::vector<const BoardView*>& views,
                                        const Lattice& lattice, const LensSettings& settings);

// Whether cameras that are solved together saw each board at one place, at one instant: their solve
// against that of each camera by itself, whose boards have poses of their own.

// Together, residuals may be this many times those of each camera apart.
inline constexpr double kMostDisagreement = 1.2;

struct JointFit {
  struct Disagreeing {
    size_t placing = 0;  // LensProblem::reference_from_board
    double pixels = 0;   // what the residuals have more together, rms per axis
  };
  // Standard deviations of the residuals, per axis, of corners of weight 1: of boards that several
  // cameras saw. 0 if that is not enough to compare.
  double together = 0;
  double apart = 0;
  int placings = 0;                      // that were compared
  bool disagrees = false;                // more than kMostDisagreement
  std::vector<Disagreeing> disagreeing;  // placings that do, the worst first
};

// `start`: before SolveExactly, `together`: after it. Internal if mrcal fails.
absl::StatusOr<JointFit> CompareJointFit(const LensProblem& start, const LensProblem& together,
                                         bool fixed_lenses, bool warp, const OutlierRule& rule);

// Whether what a solve found can be relied on, in plain words.

// Fills in the statistics of each camera from residuals and covariances, and warnings.
// FailedPrecondition if a lens is known too badly, with what the images lack.
absl::Status JudgeLenses(const std::vector<LensCamera>& cameras, const LensSettings& settings,
                         LensSolution& solution);

}  // namespace silhouette
