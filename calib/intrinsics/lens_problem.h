// SPDX-License-Identifier: Apache-2.0
// LensProblem: cameras that look at boards, as mrcal takes them, and what mrcal does with them.
//
// A board is a lattice of width x height corner points, spacing apart, in the plane z = 0 of
// its frame, point (i, j) at (i * spacing, j * spacing, 0); it may be bent (`warp`). Each placing
// of a board is a pose of its own. The reference is the frame of the first camera. Pixels and
// metres. mrcal keeps state of its own: one call at a time.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/boards/board.h"

namespace silhouette {

// What mrcal's lens models do with points and pixels. Pixels (integers at pixel centres) and
// metres; may be used by any number of threads.

// The number of a lens model's parameters. InvalidArgument: mrcal does not know the name, or cannot
// solve for it.
absl::StatusOr<int> LensParameters(const std::string& lens_model);
// Whether the model is one of splines; its first four parameters cannot be solved for.
bool IsSplined(const std::string& lens_model);

struct LensDerivatives {
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::MatrixXd by_intrinsics;  // 2 x parameters
};
// The pixel of a point in the camera's frame; nothing if the model has none.
std::optional<Eigen::Vector2d> ProjectByLens(const std::string& lens_model,
                                             const std::vector<double>& intrinsics,
                                             const Eigen::Vector3d& point,
                                             LensDerivatives* derivatives = nullptr);
// The direction, of unit length, that a pixel sees; nothing if the model has none.
std::optional<Eigen::Vector3d> UnprojectByLens(const std::string& lens_model,
                                               const std::vector<double>& intrinsics,
                                               const Eigen::Vector2d& pixel);

// point_out = pose * point, with its derivative by the pose's rotation vector and translation.
Eigen::Matrix<double, 3, 6> DerivativeByPose(const Eigen::Isometry3d& pose,
                                             const Eigen::Vector3d& point);

// Weights of corners that do not count.
inline constexpr double kNoCorner = -1;
inline constexpr double kOutlier = -2;

struct LensProblem {
  struct Observation {
    int camera = 0;
    int board = 0;  // which placing
  };

  std::string lens_model;  // mrcal's name, of all cameras
  std::vector<std::array<int, 2>> image_sizes;
  std::vector<std::vector<double>> intrinsics;  // of each camera, as the lens model has them
  std::vector<Eigen::Isometry3d> camera_from_reference;  // the first is the identity
  std::vector<Eigen::Isometry3d> reference_from_board;
  // How far the board's middle stands out of the plane through its corners, by the bend along its
  // width and along its height.
  Eigen::Vector2d warp = Eigen::Vector2d::Zero();

  Lattice lattice;
  std::vector<Observation> observations;  // by placing
  // width * height for each observation, row by row: pixel x, pixel y, weight.
  std::vector<Eigen::Vector3d> corners;

  size_t CornersPerBoard() const {
    return static_cast<size_t>(lattice.width) * static_cast<size_t>(lattice.height);
  }
};

// What a solve may change.
struct FreeParts {
  bool core = false;        // focal lengths and principal points
  bool distortion = false;  // the other parameters of the lenses
  bool poses = true;        // of the cameras and boards
  bool warp = false;
  // Pulls the distortion towards none and the principal point to the image's middle, weakly.
  bool regularisation = false;
};

// Makes the weighted squares of the distances between corners and their projections as small as can
// be. Internal if mrcal fails.
absl::Status Solve(LensProblem& problem, const FreeParts& free);

// Projection minus measurement, unweighted, of each of problem.corners; NaN where there is none.
std::vector<Eigen::Vector2d> Residuals(const LensProblem& problem);

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongMatrix6 = Eigen::Matrix<long double, 6, 6>;

// Where in the shared part of a solve's state the parameters are; -1: held fixed.
struct StatePlaces {
  std::vector<int> intrinsics;  // of each camera
  int first_intrinsic = 0;      // which of the lens's parameters stands there
  int free_intrinsics = 0;      // and how many follow, with it
  std::vector<int> pose;        // of each camera: rotation vector, translation
  int field = -1;  // where the shifts of the first camera's CommonField begin; -1: none
};

// The derivatives of all weighted residuals by the state that a solve may change, summed up as the
// normal equations need them: the state is `shared` (lenses, cameras, warp), then 6 of each
// placing. The terms of a rational lens are so much alike that their squares would be lost in a
// double.
struct NormalEquations {
  LongMatrix shared;               // shared x shared
  std::vector<LongMatrix6> board;  // of each placing
  std::vector<LongMatrix> mixed;   // shared x 6, of each placing
  StatePlaces places;
  int measurements = 0;  // residuals that count, two of a corner
  int states = 0;
  double squares = 0;  // sum of the squared weighted residuals
  // The weighted residuals, two of each of LensProblem::corners, and their derivatives; 0 of those
  // that do not count.
  Eigen::VectorXd residuals;
  Eigen::SparseMatrix<double, Eigen::RowMajor> jacobian;
};
absl::StatusOr<NormalEquations> NormalEquationsOf(const LensProblem& problem,
                                                  const FreeParts& free);

// LensCovariance: how uncertain the lenses and poses of a solve are, and with them any projection.

// The covariance of the shared part of the state (NormalEquations), followed by six more: by which
// small motion (rotation vector, translation) the boards, all together, stand elsewhere than they
// did in truth. Points of a workspace are fixed to the boards, so they are moved by it. Then, if
// all images of a camera share errors as its lens model lacks a term, the shifts of its
// CommonField.
struct LensCovariance {
  Eigen::MatrixXd covariance;
  StatePlaces places;
  double chi_squared = 0;                       // of the solve, per degree of freedom
  std::vector<std::array<int, 2>> image_sizes;  // of the cameras
};

// For the optimum that `problem` holds, whose weights are 1 / standard deviation up to a common
// factor: that is found from the residuals, as is what corners of one image have in common
// (OwnFields). FailedPrecondition: the state is not determined.
absl::StatusOr<LensCovariance> CovarianceOf(const LensProblem& problem, const FreeParts& free);

// How the projection of a point in the reference moves with the state that `covariance` is of.
// Nothing if there is no projection.
std::optional<Eigen::Matrix<double, 2, Eigen::Dynamic>> DerivativeOfProjection(
    const LensCovariance& covariance, size_t camera, const std::string& lens_model,
    const std::vector<double>& intrinsics, const Eigen::Isometry3d& camera_from_reference,
    const Eigen::Vector3d& point);

}  // namespace silhouette
