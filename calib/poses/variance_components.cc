// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/variance_components.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <utility>

namespace silhouette {
namespace {

using Columns = Eigen::SparseMatrix<double>;

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

VarianceComponents::VarianceComponents(LeastSquares solved, std::vector<ErrorRows> parts)
    : solved_(std::move(solved)) {
  for (ErrorRows& by_shift : parts) {
    Part& part = parts_.emplace_back();
    part.by_shift = std::move(by_shift);
    part.of_state = part.by_shift.transpose() * solved_.jacobian;
    if (part.of_state.rows() > part.of_state.cols()) {
      part.squares = Columns(part.of_state.transpose() * part.of_state);
      part.follow = part.squares * solved_.inverse;
    } else {
      part.follow = part.of_state * solved_.inverse;
    }
  }
  FindExpected();
}

// The trace of C J'Z_a Z_a'Z_b Z_b'J, where C is the state's inverse.
double VarianceComponents::MixedTrace(const Part& a, const Part& b) const {
  if (!b.many() && a.many()) return MixedTrace(b, a);
  const ErrorRows both = a.by_shift.transpose() * b.by_shift;
  const ErrorRows moved = both * b.of_state;
  if (!a.many()) return moved.cwiseProduct(a.follow).sum();
  const ErrorRows mixed = a.of_state.transpose() * moved;
  return mixed.cwiseProduct(solved_.inverse).sum();
}

// The trace of C J'Z_a Z_a'J C J'Z_b Z_b'J.
double VarianceComponents::FollowingTrace(const Part& a, const Part& b) const {
  if (!b.many() && a.many()) return FollowingTrace(b, a);
  if (!a.many()) {
    if (!b.many()) return (b.of_state * a.follow.transpose()).squaredNorm();
    return (a.follow * b.squares).cwiseProduct(a.follow).sum();
  }
  return a.follow.cwiseProduct(b.follow.transpose()).sum();
}

// The squares of Z_i'(I - J C J')Z_j.
void VarianceComponents::FindExpected() {
  const Eigen::Index count = std::ssize(parts_);
  expected_.resize(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const Part& a = parts_[static_cast<size_t>(i)];
      const Part& b = parts_[static_cast<size_t>(j)];
      const ErrorRows both = a.by_shift.transpose() * b.by_shift;
      expected_(i, j) = expected_(j, i) =
          both.squaredNorm() - 2 * MixedTrace(a, b) + FollowingTrace(a, b);
    }
  }
  for (Part& part : parts_) part.follow.resize(0, 0);
}

Eigen::VectorXd VarianceComponents::Variances(
    const Eigen::VectorXd& residuals, const std::vector<std::optional<double>>& known) const {
  Eigen::VectorXd squares(std::ssize(parts_));
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(std::ssize(parts_));
  std::vector<Eigen::Index> sought;
  for (Eigen::Index i = 0; i < squares.size(); ++i) {
    const auto place = static_cast<size_t>(i);
    squares[i] = (parts_[place].by_shift.transpose() * residuals).squaredNorm();
    if (known[place]) {
      variances[i] = *known[place];
    } else {
      sought.push_back(i);
    }
  }
  SolveWithoutNegative(expected_, squares - expected_ * variances, sought, variances);
  return variances;
}

Eigen::MatrixXd VarianceComponents::Covariance(const Eigen::VectorXd& variances, Eigen::Index first,
                                               Eigen::Index count) const {
  const auto inverse = solved_.inverse.middleCols(first, count);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(count, count);
  for (size_t i = 0; i < parts_.size(); ++i) {
    const double variance = variances[static_cast<Eigen::Index>(i)];
    if (parts_[i].many()) {
      covariance += variance * inverse.transpose() * (parts_[i].squares * inverse);
    } else {
      const Eigen::MatrixXd pulled = parts_[i].of_state * inverse;
      covariance += variance * pulled.transpose() * pulled;
    }
  }
  return covariance;
}

FoundUnknowns VarianceComponents::Find(const ErrorRows& by_unknown,
                                       const Eigen::VectorXd& variances) const {
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
        Eigen::MatrixXd(parts_[i].by_shift.transpose() * by_unknown) - parts_[i].of_state * follow;
    errors += variances[static_cast<Eigen::Index>(i)] * pulled.transpose() * pulled;
  }
  FoundUnknowns found;
  found.values = -(inverse * (moved.transpose() * solved_.residuals));
  found.covariance = inverse * errors * inverse;
  found.state = -(follow * found.values);
  found.residuals = solved_.residuals + moved * found.values;
  return found;
}

// As Find, where each sum grows by a step: of the sums only products of the size of the state are
// kept, and added to.
std::vector<double> VarianceComponents::Chi2FromEachOn(const std::vector<Columns>& by_unknown,
                                                       const Eigen::VectorXd& variances) const {
  if (by_unknown.empty()) return {};
  const Eigen::Index states = solved_.inverse.rows();
  const Eigen::Index unknowns = by_unknown.front().cols();
  const auto zero = [&](Eigen::Index rows) { return Eigen::MatrixXd::Zero(rows, unknowns).eval(); };
  Columns squares(states, states);     // of the parts of many shifts, together
  std::vector<Eigen::MatrixXd> pulls;  // Z'U of each part, where U is the sum
  for (size_t i = 0; i < parts_.size(); ++i) {
    const double variance = variances[static_cast<Eigen::Index>(i)];
    if (parts_[i].many()) squares += variance * parts_[i].squares;
    pulls.push_back(zero(parts_[i].of_state.rows()));
  }
  const Eigen::VectorXd state_pull = solved_.jacobian.transpose() * solved_.residuals;
  Eigen::MatrixXd of_state = zero(states);                 // J'U
  Eigen::MatrixXd follow = zero(states);                   // C J'U
  Eigen::MatrixXd own_squares = zero(unknowns);            // U'U
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(unknowns);  // U'r
  Eigen::MatrixXd part_squares = zero(unknowns);           // U'ZZ'U of the parts of many shifts
  Eigen::MatrixXd part_states = zero(states);              // J'ZZ'U of them
  std::vector<double> chi2(by_unknown.size());
  for (size_t step = by_unknown.size(); step-- > 0;) {
    const Columns& added = by_unknown[step];
    const Columns added_state = solved_.jacobian.transpose() * added;
    of_state += added_state;
    follow += solved_.inverse * added_state;
    own_squares += added.transpose() * added;
    pull += added.transpose() * solved_.residuals;
    for (size_t i = 0; i < parts_.size(); ++i) {
      const Columns added_pull = parts_[i].by_shift.transpose() * added;
      if (parts_[i].many()) {
        const double variance = variances[static_cast<Eigen::Index>(i)];
        const Eigen::MatrixXd mixed = added_pull.transpose() * pulls[i];
        part_squares += variance * (mixed + mixed.transpose());
        part_squares += variance * (added_pull.transpose() * added_pull);
        part_states += variance * (parts_[i].of_state.transpose() * added_pull);
      }
      pulls[i] += added_pull;
    }
    const Eigen::MatrixXd inverse = PseudoInverse(own_squares - of_state.transpose() * follow);
    const Eigen::MatrixXd mixed = part_states.transpose() * follow;
    Eigen::MatrixXd errors =
        part_squares - mixed - mixed.transpose() + follow.transpose() * (squares * follow);
    for (size_t i = 0; i < parts_.size(); ++i) {
      if (parts_[i].many()) continue;
      const Eigen::MatrixXd pulled = pulls[i] - parts_[i].of_state * follow;
      errors += variances[static_cast<Eigen::Index>(i)] * pulled.transpose() * pulled;
    }
    const Eigen::VectorXd values = inverse * (pull - follow.transpose() * state_pull);
    chi2[step] = values.dot(PseudoInverse(inverse * errors * inverse) * values);
  }
  return chi2;
}

}  // namespace silhouette
