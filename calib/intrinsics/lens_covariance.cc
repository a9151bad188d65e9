// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_problem.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <optional>
#include <utility>

#include "calib/camera/camera_model.h"
#include "calib/camera/common_field.h"
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

// A matrix R such that R'R is the inverse of a symmetric, positive matrix. FailedPrecondition if it
// is none.
absl::StatusOr<LongMatrix> RootOfInverse(const LongMatrix& matrix) {
  if (matrix.size() == 0) return matrix;
  // Scaled, as lengths and pixels are not of one size.
  const Eigen::Matrix<long double, Eigen::Dynamic, 1> scale =
      matrix.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return Undetermined();
  const LongMatrix scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::LDLT<LongMatrix> solver(scaled);
  if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > kLeastDetermined)) {
    return Undetermined();
  }
  LongMatrix root = solver.transpositionsP() * LongMatrix(scale.asDiagonal());
  solver.matrixL().solveInPlace(root);
  return LongMatrix(solver.vectorD().cwiseSqrt().cwiseInverse().asDiagonal() * root);
}

// The derivatives of the corners by the shifts of the cameras' CommonField.
SolvedResiduals::Rows ByField(const LensProblem& problem) {
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t i = 0; i < problem.corners.size(); ++i) {
    const Eigen::Vector3d& corner = problem.corners[i];
    if (!(corner.z() > 0)) continue;
    const int camera = problem.observations[i / problem.CornersPerBoard()].camera;
    const auto& [width, height] = problem.image_sizes[static_cast<size_t>(camera)];
    const auto row = static_cast<int>(2 * i);
    for (const KnotShare& knot : KnotsAt(corner.head<2>(), width, height)) {
      const int column = 2 * (camera * kFieldKnots + knot.knot);
      entries.emplace_back(row, column, knot.share * corner.z());
      entries.emplace_back(row + 1, column + 1, knot.share * corner.z());
    }
  }
  SolvedResiduals::Rows field(2 * std::ssize(problem.corners),
                              2 * kFieldKnots * std::ssize(problem.image_sizes));
  field.setFromTriplets(entries.begin(), entries.end());
  return field;
}

// The rows of the corners of each placing.
std::vector<std::vector<int>> RowsOfPlacings(const LensProblem& problem) {
  std::vector<std::vector<int>> rows(problem.reference_from_board.size());
  for (size_t i = 0; i < problem.corners.size(); ++i) {
    if (!(problem.corners[i].z() > 0)) continue;
    const auto board =
        static_cast<size_t>(problem.observations[i / problem.CornersPerBoard()].board);
    rows[board].insert(rows[board].end(), {static_cast<int>(2 * i), static_cast<int>(2 * i + 1)});
  }
  return rows;
}

// `root`: of the inverse of the normal equations without the boards, as RootOfInverse has it.
SolvedResiduals SolvedBy(const LensProblem& problem, const NormalEquations& n,
                         const LongMatrix& root) {
  const Eigen::Index shared = root.rows();
  // What X has in the rows of a placing; with it the boards' poses are eliminated.
  const auto of_board = [&n, shared](size_t i, const LongMatrix& x) -> LongMatrix {
    return n.board[i].ldlt().solve(
        LongMatrix(x.middleRows<6>(shared + static_cast<Eigen::Index>(6 * i))));
  };
  const auto times = [&n, &root, shared, of_board](const Eigen::MatrixXd& given) {
    LongMatrix x = given.cast<long double>();
    for (size_t i = 0; i < n.board.size(); ++i) x.topRows(shared) -= n.mixed[i] * of_board(i, x);
    x.topRows(shared) = (root.transpose() * (root * x.topRows(shared))).eval();
    for (size_t i = 0; i < n.board.size(); ++i) {
      auto rows = x.middleRows<6>(shared + static_cast<Eigen::Index>(6 * i));
      rows -= n.mixed[i].transpose() * x.topRows(shared);
      rows = of_board(i, x);
    }
    return Eigen::MatrixXd(x.cast<double>());
  };
  const auto root_times = [&n, &root, shared](size_t i, const Eigen::MatrixXd& given) {
    const Eigen::LLT<LongMatrix6> board(n.board[i]);
    const LongMatrix own =
        given.middleRows<6>(shared + static_cast<Eigen::Index>(6 * i)).cast<long double>();
    LongMatrix x(shared + 6, given.cols());
    x.topRows(shared) =
        root * (given.topRows(shared).cast<long double>() - n.mixed[i] * board.solve(own));
    x.bottomRows(6) = board.matrixL().solve(own);
    return Eigen::MatrixXd(x.cast<double>());
  };
  return {.by_state = n.jacobian,
          .by_field = ByField(problem),
          .residuals = n.residuals,
          .clusters = RowsOfPlacings(problem),
          .covariance_times = times,
          .root_times = root_times};
}

// Adds what the fields of the placings' images do to the state. `root`: as SolvedBy has it.
void AddOwnFields(const OwnFields& fields, const NormalEquations& n, const LongMatrix& root,
                  const LongMatrix& motion_by_shared, const std::vector<Matrix6>& motion,
                  LensCovariance& result) {
  const Eigen::Index shared = root.rows();
  for (size_t i = 0; i < n.board.size(); ++i) {
    const LongMatrix pull = Eigen::MatrixXd(fields.pulls[i]).cast<long double>();
    const LongMatrix by_board = n.board[i].ldlt().solve(
        LongMatrix(pull.middleRows<6>(shared + static_cast<Eigen::Index>(6 * i))));
    LongMatrix moved(shared + 6, pull.cols());
    moved.topRows(shared) =
        root.transpose() * (root * (pull.topRows(shared) - n.mixed[i] * by_board));
    moved.bottomRows(6) =
        motion_by_shared * moved.topRows(shared) + motion[i].cast<long double>() * by_board;
    const Eigen::MatrixXd by_shifts = fields.sigma * moved.cast<double>();
    result.covariance += by_shifts * by_shifts.transpose();
  }
}

// Adds what the field does to the state, and the field.
void AddField(const FoundField& field, const std::vector<Matrix6>& motion, LensCovariance& result) {
  const Eigen::Index before = result.covariance.rows();
  const Eigen::Index shared = before - 6;
  const Eigen::Index shifts = field.motion.cols();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(before + shifts, shifts);
  root.topRows(shared) = field.motion.topRows(shared);
  for (size_t i = 0; i < motion.size(); ++i) {
    root.middleRows<6>(shared) +=
        motion[i] * field.motion.middleRows<6>(shared + static_cast<Eigen::Index>(6 * i));
  }
  root.bottomRows(shifts).setIdentity();
  root *= field.sigma;
  Eigen::MatrixXd covariance = root * root.transpose();
  covariance.topLeftCorner(before, before) += result.covariance;
  result.covariance = std::move(covariance);
  result.places.field = static_cast<int>(before);
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
  ASSIGN_OR_RETURN(const LongMatrix root, RootOfInverse(reduced));
  const LongMatrix inverse = root.transpose() * root;
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
  const SolvedResiduals solved = SolvedBy(problem, n, root);
  const OwnFields own = FindOwnFields(solved, freedom);
  result.covariance *= own.noise;
  AddOwnFields(own, n, root, motion_by_shared, motion, result);
  result.places = n.places;
  result.image_sizes = problem.image_sizes;
  if (const auto field = FindCommonField(solved, own)) AddField(*field, motion, result);
  if (!result.covariance.allFinite()) return undetermined;
  return result;
}

std::optional<Eigen::Matrix<double, 2, Eigen::Dynamic>> DerivativeOfProjection(
    const LensCovariance& covariance, size_t camera, const std::string& lens_model,
    const std::vector<double>& intrinsics, const Eigen::Isometry3d& camera_from_reference,
    const Eigen::Vector3d& point) {
  LensDerivatives lens;
  const auto pixel = ProjectByLens(lens_model, intrinsics, camera_from_reference * point, &lens);
  if (!pixel) return std::nullopt;
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
  const Eigen::Index motion = places.field >= 0 ? places.field - 6 : states - 6;
  derivative.middleCols<6>(motion) =
      lens.by_point * camera_from_reference.linear() * DerivativeByMotion(point);
  if (places.field >= 0) {
    const auto& [width, height] = covariance.image_sizes[camera];
    const Eigen::Index first = places.field + 2 * kFieldKnots * static_cast<Eigen::Index>(camera);
    for (const KnotShare& knot : KnotsAt(*pixel, width, height)) {
      derivative.middleCols<2>(first + 2 * knot.knot) -= knot.share * Eigen::Matrix2d::Identity();
    }
  }
  return derivative;
}

}  // namespace silhouette
