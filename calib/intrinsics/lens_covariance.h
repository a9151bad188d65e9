// LensCovariance: how uncertain the lenses and poses of a solve are, and with them any projection.
#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "calib/intrinsics/lens_problem.h"

namespace silhouette {

// The covariance of the shared part of the state (NormalEquations), followed by six more: by which
// small motion (rotation vector, translation) the boards, all together, stand elsewhere than they
// did in truth. Points of a workspace are fixed to the boards, so they are moved by it.
struct LensCovariance {
  Eigen::MatrixXd covariance;
  // Where in it the parameters are; -1: held fixed.
  std::vector<int> intrinsics;
  int first_intrinsic = 0;
  int free_intrinsics = 0;
  std::vector<int> pose;
  double chi_squared = 0;  // of the solve, per degree of freedom
};

// For the optimum that `problem` holds, whose weights are 1 / standard deviation up to a common
// factor: that is found from the residuals. FailedPrecondition: the state is not determined.
absl::StatusOr<LensCovariance> CovarianceOf(const LensProblem& problem, const FreeParts& free);

// How the projection of a point in the reference moves with the state that `covariance` is of.
// Nothing if there is no projection.
std::optional<Eigen::Matrix<double, 2, Eigen::Dynamic>> DerivativeOfProjection(
    const LensCovariance& covariance, size_t camera, const std::string& lens_model,
    const std::vector<double>& intrinsics, const Eigen::Isometry3d& camera_from_reference,
    const Eigen::Vector3d& point);

}  // namespace silhouette
