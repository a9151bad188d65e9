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
  Eigen::VectorXd scale;  // state = scale * `errors.solved()`'s state
  // Two rows per used corner, in their order, then the priors'. Parts: of robot and survey, of each
  // corner, of each look, of each camera.
  VarianceComponents errors;
  Eigen::VectorXd variances;  // of the parts
};

// After FindCovariances: the covariances and size sigmas again, with errors that corners have in
// common: those of one image, as by blur, time and print, and those of all images of a camera, as
// its lens model lacks a term. The residuals tell how large they are (VarianceComponents). Errors
// as of LinearBundle::Of.
absl::StatusOr<LinearBundle> CountCommonErrors(Bundle& bundle);

}  // namespace silhouette
