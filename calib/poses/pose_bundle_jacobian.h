// The derivatives of a bundle's residuals, for its statistics.
#pragma once

#include <Eigen/SparseCore>
#include <optional>
#include <vector>

#include "calib/poses/pose_bundle.h"

namespace silhouette {

// A pose (six columns: rotation, translation) or a size factor (one) that is sought.
struct BundleBlock {
  BundlePose* pose = nullptr;
  int size = -1;
  int column = 0;
  int width() const { return pose != nullptr ? 6 : 1; }
};

struct BundleJacobian {
  std::vector<BundleBlock> blocks;
  // A row per residual (in sigmas) of the used corners and the priors.
  Eigen::SparseMatrix<double> jacobian;
  double chi2 = 0;  // the residuals' sum of squares
};

// At the poses as they are. Nothing if a used corner lies behind its camera or nothing is sought.
std::optional<BundleJacobian> JacobianOf(Bundle& bundle);

}  // namespace silhouette
