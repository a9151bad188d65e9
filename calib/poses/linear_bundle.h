// SPDX-License-Identifier: Apache-2.0
// LinearBundle: a bundle near its minimum as a linear least-squares problem, with the errors that
// its corners have in common.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_bundle.h"
#include "calib/poses/variance_components.h"

namespace silhouette {

struct LinearBundle {
  // FailedPrecondition: the data do not determine all poses. The blocks' poses are the bundle's.
  static absl::StatusOr<LinearBundle> Of(Bundle& bundle);

  std::vector<BundleBlock> blocks;
  Eigen::VectorXd scale;  // state = scale * `solved`'s state
  LeastSquares solved;    // two rows per used corner, in their order, then the priors'
  // Of robot and survey, of each corner, of each look, of each camera; with their variances.
  std::vector<ErrorPart> parts;
  Eigen::MatrixXd covariance;  // of the state
};

}  // namespace silhouette
