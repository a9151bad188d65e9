// SPDX-License-Identifier: Apache-2.0
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "calib/camera/common_field.h"
#include "calib/poses/linear_bundle.h"
#include "calib/poses/pose_bundle.h"
#include "calib/poses/variance_components.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Knots of a field of errors. Poses follow what is smooth: closer knots understate its variance, as
// they share it with fine errors. How smooth a lens's errors are, the residuals do not tell.
constexpr int kKnotColumns = 4;
constexpr int kKnotRows = 3;
constexpr int kShifts = 2 * kKnotColumns * kKnotRows;

// The shifts that fields of errors add to the corners, as rows of the residuals: a field of each
// look, or of each camera, by `field_of`.
template <typename FieldOf>
ErrorRows FieldErrors(const Bundle& bundle, Eigen::Index rows, const FieldOf& field_of) {
  std::vector<Eigen::Triplet<double>> entries;
  int row = 0;
  int columns = 0;
  for (const BundleCorner& corner : bundle.corners) {
    if (!corner.used) continue;
    const CameraIntrinsics& lens = bundle.lenses[corner.camera];
    const int first = kShifts * static_cast<int>(field_of(corner));
    columns = std::max(columns, first + kShifts);
    for (const KnotShare& knot :
         KnotsAt(corner.pixel, lens.width, lens.height, kKnotColumns, kKnotRows)) {
      for (const int axis : {0, 1}) {
        entries.emplace_back(row + axis, first + 2 * knot.knot + axis, knot.share / corner.sigma);
      }
    }
    row += 2;
  }
  ErrorRows by_shift(rows, columns);
  by_shift.setFromTriplets(entries.begin(), entries.end());
  return by_shift;
}

// Errors of each of the rows `first` to `last` - 1 by itself, in sigmas.
ErrorRows OwnErrors(Eigen::Index rows, Eigen::Index first, Eigen::Index last) {
  ErrorRows by_shift(rows, rows);
  for (Eigen::Index row = first; row < last; ++row) by_shift.insert(row, row) = 1;
  return by_shift;
}

std::vector<ErrorRows> PartsOf(const Bundle& bundle, Eigen::Index rows) {
  const auto used = std::ranges::count_if(bundle.corners, &BundleCorner::used);
  return {OwnErrors(rows, 2 * used, rows), OwnErrors(rows, 0, 2 * used),
          FieldErrors(bundle, rows, [](const BundleCorner& c) { return c.look; }),
          FieldErrors(bundle, rows, [](const BundleCorner& c) { return c.camera; })};
}

}  // namespace

absl::StatusOr<LinearBundle> LinearBundle::Of(Bundle& bundle) {
  constexpr double kLeastShare = 1e-11;  // of a scaled pivot: below, it is rounding
  const absl::Status unknown = FailedPrecondition(
      "how uncertain the poses are cannot be found, as the data hardly determine them; add frames "
      "with the flange turned about other axes");
  std::optional<BundleJacobian> derivatives = JacobianOf(bundle);
  if (!derivatives) return unknown;
  LinearBundle linear;
  linear.blocks = std::move(derivatives->blocks);
  const Eigen::Index states = derivatives->jacobian.cols();
  linear.scale.resize(states);
  for (int i = 0; i < states; ++i) linear.scale[i] = 1 / derivatives->jacobian.col(i).norm();
  LeastSquares solved;
  solved.jacobian = derivatives->jacobian * linear.scale.asDiagonal();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(
      Eigen::SparseMatrix<double>(solved.jacobian.transpose() * solved.jacobian));
  if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > kLeastShare)) {
    return unknown;
  }
  solved.inverse = solver.solve(Eigen::MatrixXd::Identity(states, states));
  const Eigen::Map<const Eigen::VectorXd> residuals(derivatives->residuals.data(),
                                                    std::ssize(derivatives->residuals));
  solved.residuals =
      residuals - solved.jacobian * (solved.inverse * (solved.jacobian.transpose() * residuals));
  std::vector<ErrorRows> parts = PartsOf(bundle, solved.jacobian.rows());
  linear.errors = VarianceComponents(std::move(solved), std::move(parts));
  // Of robot and survey, NoiseModel found the sigmas.
  linear.variances = linear.errors.Variances(linear.errors.solved().residuals,
                                             {1.0, std::nullopt, std::nullopt, std::nullopt});
  if (!linear.variances.allFinite()) return unknown;
  return linear;
}

absl::StatusOr<LinearBundle> CountCommonErrors(Bundle& bundle) {
  ASSIGN_OR_RETURN(LinearBundle linear, LinearBundle::Of(bundle));
  for (const BundleBlock& block : linear.blocks) {
    const auto scale = linear.scale.segment(block.column, block.width()).asDiagonal();
    const Eigen::MatrixXd found =
        scale * linear.errors.Covariance(linear.variances, block.column, block.width()) * scale;
    if (block.pose) {
      block.pose->covariance = (found + found.transpose()) / 2;
    } else {
      bundle.size_sigmas[static_cast<size_t>(block.size)] = std::sqrt(found(0, 0));
    }
  }
  return linear;
}

}  // namespace silhouette
