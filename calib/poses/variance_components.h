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

// The measurements' derivatives, a row each; of a part, by its shifts.
using ErrorRows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// A least-squares solve at its minimum, with measurements in their sigmas.
struct LeastSquares {
  ErrorRows jacobian;       // J, of the residuals by the state
  Eigen::MatrixXd inverse;  // (J'J)^-1
  Eigen::VectorXd residuals;
};

// What the residuals say of unknowns that the solve did not seek.
struct FoundUnknowns {
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;  // by the parts' errors
  Eigen::VectorXd state;       // by how much the solved state changes with them
  Eigen::VectorXd residuals;   // with them
  // values' covariance^-1 values of those from `first` on.
  double Chi2(Eigen::Index first, Eigen::Index count) const;
};

class VarianceComponents {
 public:
  VarianceComponents() = default;
  VarianceComponents(LeastSquares solved, std::vector<ErrorRows> parts);

  const LeastSquares& solved() const { return solved_; }

  // The parts' variances by these residuals, none of them below 0: those that are not `known`, by
  // the method of moments (Henderson, Biometrics 9, 1953): for each part, the squares of its pull
  // on the residuals are as large as expected.
  Eigen::VectorXd Variances(const Eigen::VectorXd& residuals,
                            const std::vector<std::optional<double>>& known) const;

  // Of the states from `first` on, by the parts' errors.
  Eigen::MatrixXd Covariance(const Eigen::VectorXd& variances, Eigen::Index first,
                             Eigen::Index count) const;

  // `by_unknown`: the residuals' derivatives. What the data do not determine of them stays 0.
  FoundUnknowns Find(const ErrorRows& by_unknown, const Eigen::VectorXd& variances) const;

  // For each i the chi2 of all unknowns whose derivatives are the sum of `by_unknown` from i on.
  // Takes about as long as finding a few of them singly.
  std::vector<double> Chi2FromEachOn(const std::vector<Eigen::SparseMatrix<double>>& by_unknown,
                                     const Eigen::VectorXd& variances) const;

 private:
  // A part with the derivatives Z.
  struct Part {
    ErrorRows by_shift;  // Z
    ErrorRows of_state;  // Z'J
    // J'ZZ'J, if there are more shifts than states; else it stays empty, as it is seldom sparse.
    Eigen::SparseMatrix<double> squares;
    Eigen::MatrixXd follow;  // by C: squares, else of_state; for FindExpected
    bool many() const { return squares.size() > 0; }
  };

  double MixedTrace(const Part& a, const Part& b) const;
  double FollowingTrace(const Part& a, const Part& b) const;
  void FindExpected();

  LeastSquares solved_;
  std::vector<Part> parts_;
  // How much the expected squares of each part's pull grow with each part's variance.
  Eigen::MatrixXd expected_;
};

}  // namespace silhouette
