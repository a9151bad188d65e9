// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/variance_components.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <utility>

namespace silhouette {
namespace {

// What the moments need of a part with the derivatives Z.
struct Pull {
  ErrorPart::Rows of_state;  // Z'J
  Eigen::MatrixXd follow;    // C J'ZZ'J
};

std::vector<Pull> PullsOf(const LeastSquares& solved, const std::vector<ErrorPart>& parts) {
  std::vector<Pull> pulls;
  for (const ErrorPart& part : parts) {
    Pull pull{.of_state = part.by_shift.transpose() * solved.jacobian, .follow{}};
    const ErrorPart::Rows squares = pull.of_state.transpose() * pull.of_state;
    pull.follow = solved.inverse * squares;
    pulls.push_back(std::move(pull));
  }
  return pulls;
}

// How much the expected squares of each part's pull grow with each part's variance: the squares of
// Z_i'(I - J C J')Z_j.
Eigen::MatrixXd Expected(const LeastSquares& solved, const std::vector<ErrorPart>& parts,
                         const std::vector<Pull>& pulls) {
  const Eigen::Index count = std::ssize(parts);
  Eigen::MatrixXd expected(count, count);
  for (size_t i = 0; i < parts.size(); ++i) {
    for (size_t j = 0; j <= i; ++j) {
      const ErrorPart::Rows both = parts[i].by_shift.transpose() * parts[j].by_shift;
      const ErrorPart::Rows moved = both * pulls[j].of_state;
      const ErrorPart::Rows mixed = pulls[i].of_state.transpose() * moved;
      const double squares = both.squaredNorm() - 2 * mixed.cwiseProduct(solved.inverse).sum() +
                             pulls[i].follow.cwiseProduct(pulls[j].follow.transpose()).sum();
      const auto row = static_cast<Eigen::Index>(i);
      const auto column = static_cast<Eigen::Index>(j);
      expected(row, column) = expected(column, row) = squares;
    }
  }
  return expected;
}

// x of least norm with a x = b for those x that are sought, none of them negative: the most
// negative is 0, one after the other.
void SolveWithoutNegative(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                          std::vector<Eigen::Index> sought, Eigen::VectorXd& x) {
  while (!sought.empty()) {
    const Eigen::VectorXd scale = a.diagonal()(sought).cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * a(sought, sought) * scale.asDiagonal();
    const Eigen::VectorXd found =
        scaled.completeOrthogonalDecomposition().solve(scale.cwiseProduct(b(sought)));
    Eigen::Index least = 0;
    if (found.minCoeff(&least) >= 0) {
      x(sought) = scale.cwiseProduct(found);
      return;
    }
    sought.erase(sought.begin() + least);
  }
}

// Inverse of a symmetric matrix that has none below 0; of what is hardly there, 0.
Eigen::MatrixXd PseudoInverse(const Eigen::MatrixXd& matrix) {
  constexpr double kLeastShare = 1e-9;
  const Eigen::VectorXd scale = matrix.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scale.asDiagonal() * matrix *
                                                              scale.asDiagonal());
  const Eigen::VectorXd inverse = solver.eigenvalues().unaryExpr(
      [](double value) { return value > kLeastShare ? 1 / value : 0.0; });
  const Eigen::MatrixXd axes = scale.asDiagonal() * solver.eigenvectors();
  return axes * inverse.asDiagonal() * axes.transpose();
}

}  // namespace

double FoundUnknowns::Chi2(Eigen::Index first, Eigen::Index count) const {
  const Eigen::VectorXd some = values.segment(first, count);
  return some.dot(PseudoInverse(covariance.block(first, first, count, count)) * some);
}

UnknownSearch::UnknownSearch(const LeastSquares& solved, const std::vector<ErrorPart>& parts)
    : solved_(solved), parts_(parts) {
  for (const ErrorPart& part : parts) {
    pulls_.emplace_back(part.by_shift.transpose() * solved.jacobian);
  }
}

FoundUnknowns UnknownSearch::Find(const ErrorPart::Rows& by_unknown) const {
  const Eigen::MatrixXd of_state = solved_.jacobian.transpose() * by_unknown;
  const Eigen::MatrixXd follow = solved_.inverse * of_state;
  const Eigen::MatrixXd normal =
      Eigen::MatrixXd(by_unknown.transpose() * by_unknown) - of_state.transpose() * follow;
  const Eigen::MatrixXd inverse = PseudoInverse(normal);
  // By which the residuals move with the unknowns once the state has followed: W.
  const Eigen::MatrixXd moved = Eigen::MatrixXd(by_unknown) - solved_.jacobian * follow;
  Eigen::MatrixXd errors = Eigen::MatrixXd::Zero(normal.rows(), normal.cols());
  for (size_t i = 0; i < parts_.size(); ++i) {
    const Eigen::MatrixXd pulled =
        Eigen::MatrixXd(parts_[i].by_shift.transpose() * by_unknown) - pulls_[i] * follow;
    errors += *parts_[i].variance * pulled.transpose() * pulled;
  }
  FoundUnknowns found;
  found.values = -(inverse * (moved.transpose() * solved_.residuals));
  found.covariance = inverse * errors * inverse;
  found.state = -(follow * found.values);
  found.residuals = solved_.residuals + moved * found.values;
  return found;
}

Eigen::MatrixXd CovarianceByParts(const LeastSquares& solved, std::vector<ErrorPart>& parts) {
  const std::vector<Pull> pulls = PullsOf(solved, parts);
  const Eigen::MatrixXd expected = Expected(solved, parts, pulls);
  Eigen::VectorXd squares(std::ssize(parts));
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(std::ssize(parts));
  std::vector<Eigen::Index> sought;
  for (Eigen::Index i = 0; i < squares.size(); ++i) {
    const ErrorPart& part = parts[static_cast<size_t>(i)];
    squares[i] = (part.by_shift.transpose() * solved.residuals).squaredNorm();
    if (part.variance) {
      variances[i] = *part.variance;
    } else {
      sought.push_back(i);
    }
  }
  SolveWithoutNegative(expected, squares - expected * variances, sought, variances);
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(solved.inverse.rows(), solved.inverse.cols());
  for (size_t i = 0; i < parts.size(); ++i) {
    parts[i].variance = variances[static_cast<Eigen::Index>(i)];
    moved += *parts[i].variance * pulls[i].follow;
  }
  return moved * solved.inverse;
}

}  // namespace silhouette
