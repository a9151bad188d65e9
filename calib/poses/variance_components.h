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

// What the residuals say of unknowns that the solve did not seek.
struct FoundUnknowns {
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;  // by the parts' errors
  Eigen::VectorXd state;       // by how much the solved state changes with them
  Eigen::VectorXd residuals;   // with them
  // values' covariance^-1 values of those from `first` on.
  double Chi2(Eigen::Index first, Eigen::Index count) const;
};

class UnknownSearch {
 public:
  // Both must outlive this; the parts' variances are known and may change meanwhile.
  UnknownSearch(const LeastSquares& solved, const std::vector<ErrorPart>& parts);

  // `by_unknown`: the residuals' derivatives. What the data do not determine of them stays 0.
  FoundUnknowns Find(const ErrorPart::Rows& by_unknown) const;

 private:
  const LeastSquares& solved_;
  const std::vector<ErrorPart>& parts_;
  std::vector<ErrorPart::Rows> pulls_;  // Z'J of each part
};

}  // namespace silhouette
