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
ErrorPart FieldErrors(const Bundle& bundle, Eigen::Index rows, const FieldOf& field_of) {
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
  ErrorPart part{.by_shift = ErrorPart::Rows(rows, columns), .variance{}};
  part.by_shift.setFromTriplets(entries.begin(), entries.end());
  return part;
}

// Errors of each of the rows `first` to `last` - 1 by itself, in sigmas.
ErrorPart OwnErrors(Eigen::Index rows, Eigen::Index first, Eigen::Index last) {
  ErrorPart part{.by_shift = ErrorPart::Rows(rows, rows), .variance{}};
  for (Eigen::Index row = first; row < last; ++row) part.by_shift.insert(row, row) = 1;
  return part;
}

std::vector<ErrorPart> PartsOf(const Bundle& bundle, Eigen::Index rows) {
  const auto used = std::ranges::count_if(bundle.corners, &BundleCorner::used);
  std::vector<ErrorPart> parts;
  parts.push_back(OwnErrors(rows, 2 * used, rows));
  parts.back().variance = 1;  // of what robot and survey say: NoiseModel found their sigmas
  parts.push_back(OwnErrors(rows, 0, 2 * used));
  parts.push_back(FieldErrors(bundle, rows, [](const BundleCorner& c) { return c.look; }));
  parts.push_back(FieldErrors(bundle, rows, [](const BundleCorner& c) { return c.camera; }));
  return parts;
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
  LeastSquares& solved = linear.solved;
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
  linear.parts = PartsOf(bundle, solved.jacobian.rows());
  linear.covariance = linear.scale.asDiagonal() * CovarianceByParts(solved, linear.parts) *
                      linear.scale.asDiagonal();
  if (!linear.covariance.allFinite()) return unknown;
  return linear;
}

absl::Status CountCommonErrors(Bundle& bundle) {
  ASSIGN_OR_RETURN(const LinearBundle linear, LinearBundle::Of(bundle));
  for (const BundleBlock& block : linear.blocks) {
    if (block.pose) {
      const PoseCovariance found = linear.covariance.block<6, 6>(block.column, block.column);
      block.pose->covariance = (found + found.transpose()) / 2;
    } else {
      bundle.size_sigmas[static_cast<size_t>(block.size)] =
          std::sqrt(linear.covariance(block.column, block.column));
    }
  }
  return absl::OkStatus();
}

}  // namespace silhouette
