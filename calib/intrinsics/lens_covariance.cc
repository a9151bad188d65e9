// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_problem.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "calib/camera/camera_model.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Share of what a parameter says that the others must leave to it; below, it is rounding.
constexpr long double kLeastDetermined = 1e-17L;

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// The motion that fits best to the boards' corners moving with the states of their poses: the
// six rows of it for each placing.
std::vector<Matrix6> MotionByBoards(const LensProblem& problem) {
  Matrix6 squares = Matrix6::Zero();
  std::vector<Matrix6> motion;
  for (const Eigen::Isometry3d& pose : problem.reference_from_board) {
    Matrix6 mixed = Matrix6::Zero();
    for (const int i : {0, problem.lattice.width - 1}) {
      for (const int j : {0, problem.lattice.height - 1}) {
        const Eigen::Vector3d corner(i * problem.lattice.spacing, j * problem.lattice.spacing, 0);
        const auto by_motion = DerivativeByMotion(pose * corner);
        squares += by_motion.transpose() * by_motion;
        mixed += by_motion.transpose() * DerivativeByPose(pose, corner);
      }
    }
    motion.push_back(mixed);
  }
  const Eigen::LDLT<Matrix6> solver(squares);
  for (Matrix6& each : motion) each = solver.solve(each).eval();
  return motion;
}

absl::Status Undetermined() {
  return FailedPrecondition(
      "the images leave some of the lenses or poses undetermined; take more, with the board tilted "
      "and moved all over each image");
}

// Of a symmetric, positive matrix. FailedPrecondition if it is none.
absl::StatusOr<LongMatrix> Inverse(const LongMatrix& matrix) {
  const Eigen::Index size = matrix.rows();
  if (size == 0) return matrix;
  // Scaled, as lengths and pixels are not of one size.
  const Eigen::Matrix<long double, Eigen::Dynamic, 1> scale =
      matrix.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return Undetermined();
  const LongMatrix scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::LDLT<LongMatrix> solver(scaled);
  if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > kLeastDetermined)) {
    return Undetermined();
  }
  const LongMatrix inverse = solver.solve(LongMatrix::Identity(size, size));
  return LongMatrix(scale.asDiagonal() * inverse * scale.asDiagonal());
}

// LensCovariance::common_errors: how far the placings, each by itself, pull the shared state apart,
// against how far independent errors of their corners would. `inverse`: of the normal equations
// without the boards. `chi_squared`: of the solve, per degree of freedom.
double CommonErrors(const NormalEquations& n, const LongMatrix& inverse, double chi_squared) {
  constexpr double kExcess = 1.3;  // less is chance
  long double found = 0;
  long double expected = 0;
  for (size_t i = 0; i < n.board.size(); ++i) {
    const LongMatrix by_shared = Eigen::LDLT<LongMatrix6>(n.board[i]).solve(n.mixed[i].transpose());
    const LongMatrix pull = n.pull[i] - by_shared.transpose() * n.board_pull[i];
    const LongMatrix share = inverse * (n.own[i] - n.mixed[i] * by_shared);
    found += (pull.transpose() * inverse * pull).trace();
    // The solution has followed each placing by its share.
    expected += share.trace() - share.cwiseProduct(share.transpose()).sum();
  }
  const auto factor = static_cast<double>(found / (chi_squared * expected));
  return factor > kExcess && std::isfinite(factor) ? factor : 1;
}

}  // namespace

absl::StatusOr<LensCovariance> CovarianceOf(const LensProblem& problem, const FreeParts& free) {
  ASSIGN_OR_RETURN(const NormalEquations n, NormalEquationsOf(problem, free));
  const absl::Status undetermined = Undetermined();
  const Eigen::Index shared = n.shared.rows();
  const std::vector<Matrix6> motion = MotionByBoards(problem);
  // The boards' poses are eliminated one by one; what the motion owes to them is kept.
  LongMatrix reduced = n.shared;
  LongMatrix motion_by_shared = LongMatrix::Zero(6, shared);
  LongMatrix6 motion_alone = LongMatrix6::Zero();
  for (size_t i = 0; i < n.board.size(); ++i) {
    const Eigen::LDLT<LongMatrix6> board(n.board[i]);
    if (board.info() != Eigen::Success || !board.isPositive()) return undetermined;
    const LongMatrix6 by_board = motion[i].cast<long double>();
    const LongMatrix by_shared = board.solve(n.mixed[i].transpose());
    reduced -= n.mixed[i] * by_shared;
    motion_by_shared -= by_board * by_shared;
    motion_alone += by_board * board.solve(by_board.transpose());
  }
  ASSIGN_OR_RETURN(const LongMatrix inverse, Inverse(reduced));
  const LongMatrix mixed = inverse * motion_by_shared.transpose();
  LensCovariance result;
  result.covariance.resize(shared + 6, shared + 6);
  result.covariance.topLeftCorner(shared, shared) = inverse.cast<double>();
  result.covariance.topRightCorner(shared, 6) = mixed.cast<double>();
  result.covariance.bottomLeftCorner(6, shared) = mixed.transpose().cast<double>();
  const LongMatrix6 moved = motion_alone + motion_by_shared * mixed;
  result.covariance.bottomRightCorner(6, 6) = moved.cast<double>();
  const int freedom = n.measurements - n.states;
  if (freedom <= 0) return undetermined;
  result.chi_squared = n.squares / freedom;
  result.common_errors = CommonErrors(n, inverse, result.chi_squared);
  result.covariance *= result.chi_squared * result.common_errors;
  if (!result.covariance.allFinite()) return undetermined;
  result.places = n.places;
  return result;
}

std::optional<Eigen::Matrix<double, 2, Eigen::Dynamic>> DerivativeOfProjection(
    const LensCovariance& covariance, size_t camera, const std::string& lens_model,
    const std::vector<double>& intrinsics, const Eigen::Isometry3d& camera_from_reference,
    const Eigen::Vector3d& point) {
  LensDerivatives lens;
  if (!ProjectByLens(lens_model, intrinsics, camera_from_reference * point, &lens)) {
    return std::nullopt;
  }
  const Eigen::Index states = covariance.covariance.rows();
  Eigen::Matrix<double, 2, Eigen::Dynamic> derivative =
      Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, states);
  const StatePlaces& places = covariance.places;
  if (const int at = places.intrinsics[camera]; at >= 0 && places.free_intrinsics > 0) {
    derivative.middleCols(at, places.free_intrinsics) =
        lens.by_intrinsics.middleCols(places.first_intrinsic, places.free_intrinsics);
  }
  if (const int at = places.pose[camera]; at >= 0) {
    derivative.middleCols(at, 6) = lens.by_point * DerivativeByPose(camera_from_reference, point);
  }
  derivative.rightCols(6) =
      lens.by_point * camera_from_reference.linear() * DerivativeByMotion(point);
  return derivative;
}

}  // namespace silhouette
