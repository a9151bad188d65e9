// SPDX-License-Identifier: Apache-2.0
// Variance components: errors of measurements as a sum of parts, each of shifts that are
// independent of each other and of one variance. A part may move many measurements at once, as blur
// moves all corners of an image. The residuals of a least-squares solve tell the variances.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <optional>
#include <vector>

namespace silhouette {

struct ErrorPart {
  using Rows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  Rows by_shift;                   // the measurements' derivatives
  std::optional<double> variance;  // of a shift; nothing: to be found
};

// A least-squares solve at its minimum, with measurements in their sigmas.
struct LeastSquares {
  ErrorPart::Rows jacobian;  // J, of the residuals by the state
  Eigen::MatrixXd inverse;   // (J'J)^-1
  Eigen::VectorXd residuals;
};

// The state's covariance by the parts' errors. Finds the variances that are not known, none of them
// below 0, by the method of moments (Henderson, Biometrics 9, 1953): for each part, the squares of
// its pull on the residuals are as large as expected.
Eigen::MatrixXd CovarianceByParts(const LeastSquares& solved, std::vector<ErrorPart>& parts);

}  // namespace silhouette
