// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "calib/camera/common_field.h"
#include "calib/poses/pose_bundle.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// The rows that have errors in common: those of a flange's pose, else those of a look, else each.
std::vector<std::vector<int>> Clusters(Bundle& bundle, const BundleJacobian& derivatives,
                                       const RowMajor& jacobian) {
  std::vector<int> flange_of_column(static_cast<size_t>(jacobian.cols()), -1);
  for (const BundleBlock& block : derivatives.blocks) {
    const auto flange =
        std::ranges::find(bundle.flanges, block.pose, [](BundlePose& pose) { return &pose; });
    if (flange == bundle.flanges.end()) continue;
    std::fill_n(flange_of_column.begin() + block.column, 6,
                static_cast<int>(flange - bundle.flanges.begin()));
  }
  std::vector<size_t> look_of_row;
  for (const BundleCorner& corner : bundle.corners) {
    if (corner.used) look_of_row.insert(look_of_row.end(), 2, corner.look);
  }
  std::map<std::pair<int, size_t>, std::vector<int>> rows;
  for (int row = 0; row < jacobian.rows(); ++row) {
    int flange = -1;
    for (RowMajor::InnerIterator entry(jacobian, row); entry; ++entry) {
      flange = std::max(flange, flange_of_column[static_cast<size_t>(entry.col())]);
    }
    const auto at = static_cast<size_t>(row);
    std::pair<int, size_t> key(-2, at);
    if (flange >= 0) {
      key = {flange, 0};
    } else if (at < look_of_row.size()) {
      key = {-1, look_of_row[at]};
    }
    rows[key].push_back(row);
  }
  std::vector<std::vector<int>> clusters;
  for (auto& [key, of_cluster] : rows) clusters.push_back(std::move(of_cluster));
  return clusters;
}

// The normal equations of a bundle at its minimum, with their diagonal scaled to one.
struct Normals {
  BundleJacobian derivatives;
  Eigen::VectorXd scale;
  RowMajor jacobian;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
  std::vector<std::vector<int>> clusters;
};

// Y with Y'Y = X'C X, for C the inverse of the normal equations.
Eigen::MatrixXd RootTimes(const Normals& normals, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd root = normals.solver.permutationP() * x;
  normals.solver.matrixL().solveInPlace(root);
  return normals.solver.vectorD().cwiseSqrt().cwiseInverse().asDiagonal() * root;
}

// The derivatives of a cluster's residuals by the few states that they depend on.
struct ClusterRows {
  std::vector<int> states;
  Eigen::MatrixXd by_state;
  Eigen::VectorXd residuals;
};

ClusterRows RowsOf(const std::vector<int>& rows, const Normals& normals) {
  std::map<int, Eigen::Index> places;
  for (const int row : rows) {
    for (RowMajor::InnerIterator entry(normals.jacobian, row); entry; ++entry) {
      places.emplace(static_cast<int>(entry.col()), std::ssize(places));
    }
  }
  ClusterRows result;
  result.states.resize(places.size());
  for (const auto& [state, place] : places) result.states[static_cast<size_t>(place)] = state;
  result.by_state = Eigen::MatrixXd::Zero(std::ssize(rows), std::ssize(places));
  result.residuals.resize(std::ssize(rows));
  for (Eigen::Index i = 0; i < result.residuals.size(); ++i) {
    const int row = rows[static_cast<size_t>(i)];
    for (RowMajor::InnerIterator entry(normals.jacobian, row); entry; ++entry) {
      result.by_state(i, places.at(static_cast<int>(entry.col()))) = entry.value();
    }
    result.residuals[i] = normals.derivatives.residuals[static_cast<size_t>(row)];
  }
  return result;
}

// How many times larger the variance of the cameras' poses is than by independent errors; nothing
// if that cannot be found. Bias-reduced cluster-robust variance: the more the solution follows a
// cluster, the less its residuals show of its errors (Bell and McCaffrey, Survey Methodology 28,
// 2002); what it follows wholly counts for nothing (Pustejovsky and Tipton, Journal of Business and
// Economic Statistics 36, 2018).
std::optional<double> CommonErrors(const Bundle& bundle, const Normals& normals) {
  // Of the state on each camera's pose, that in directions of variance 1. Not of all cameras
  // together: how they stand to each other is known far better than where they stand.
  const Eigen::Index states = normals.jacobian.cols();
  std::vector<Eigen::MatrixXd> of_cameras;
  for (const BundleBlock& block : normals.derivatives.blocks) {
    const bool camera = std::ranges::any_of(
        bundle.cameras, [&](const BundlePose& pose) { return &pose == block.pose; });
    if (!camera) continue;
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(states, 6);
    unit.middleRows<6>(block.column).setIdentity();
    const Eigen::MatrixXd solved = normals.solver.solve(unit);
    const Eigen::LLT<Eigen::MatrixXd> covariance(solved.middleRows<6>(block.column));
    if (covariance.info() != Eigen::Success) return std::nullopt;
    of_cameras.emplace_back(covariance.matrixL().solve(solved.transpose()));
  }
  if (of_cameras.empty()) return std::nullopt;
  Eigen::MatrixXd influence(6 * std::ssize(of_cameras), states);
  for (size_t i = 0; i < of_cameras.size(); ++i) {
    influence.middleRows<6>(static_cast<Eigen::Index>(6 * i)) = of_cameras[i];
  }

  constexpr double kRedundancy = 1e-6;  // with less a cluster decides by itself
  double found = 0;
  double expected = 0;
  for (const std::vector<int>& rows : normals.clusters) {
    const ClusterRows cluster = RowsOf(rows, normals);
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(states, std::ssize(cluster.states));
    unit(cluster.states, Eigen::all).setIdentity();
    const Eigen::MatrixXd solved = normals.solver.solve(unit);
    const Eigen::LLT<Eigen::MatrixXd> covariance(solved(cluster.states, Eigen::all));
    if (covariance.info() != Eigen::Success) return std::nullopt;
    // The eigenvectors of H = A A', by which the solution follows the cluster's residuals: each by
    // a share of 0 to 1, the square of the vector's length.
    const Eigen::MatrixXd a = cluster.by_state * covariance.matrixL();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> follows(a.transpose() * a);
    const Eigen::MatrixXd directions = a * follows.eigenvectors();
    const Eigen::MatrixXd moved =
        influence(Eigen::all, cluster.states) * cluster.by_state.transpose() * directions;
    const Eigen::VectorXd along = directions.transpose() * cluster.residuals;
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(influence.rows());
    for (Eigen::Index i = 0; i < along.size(); ++i) {
      const double share = follows.eigenvalues()[i];
      if (share < kRedundancy || 1 - share < kRedundancy) continue;
      pull += moved.col(i) * along[i] / (share * std::sqrt(1 - share));
      expected += moved.col(i).squaredNorm() / share;
    }
    found += pull.squaredNorm();
  }
  if (!(expected > kRedundancy)) return 1;
  const double ratio = found / expected;
  if (!std::isfinite(ratio)) return std::nullopt;
  return ratio;
}

// The derivatives of the rows' residuals by the shifts of the cameras' CommonField.
RowMajor ByField(const Bundle& bundle, Eigen::Index rows) {
  std::vector<Eigen::Triplet<double>> entries;
  int row = 0;
  for (const BundleCorner& corner : bundle.corners) {
    if (!corner.used) continue;
    const CameraIntrinsics& lens = bundle.lenses[corner.camera];
    for (const KnotShare& knot : KnotsAt(corner.pixel, lens.width, lens.height)) {
      const int column = 2 * (corner.camera * kFieldKnots + knot.knot);
      entries.emplace_back(row, column, knot.share / corner.sigma);
      entries.emplace_back(row + 1, column + 1, knot.share / corner.sigma);
    }
    row += 2;
  }
  RowMajor field(rows, 2 * kFieldKnots * std::ssize(bundle.cameras));
  field.setFromTriplets(entries.begin(), entries.end());
  return field;
}

// How the state moves with the errors that all images of a camera share, in their standard
// deviations; nothing if there are none.
std::optional<Eigen::MatrixXd> MotionByField(const Bundle& bundle, const Normals& normals,
                                             double common_errors) {
  const std::vector<double>& residuals = normals.derivatives.residuals;
  const auto times = [&](const Eigen::MatrixXd& x) -> Eigen::MatrixXd {
    return normals.solver.solve(x);
  };
  const auto root_times = [&](size_t, const Eigen::MatrixXd& x) { return RootTimes(normals, x); };
  const auto found = FindCommonField(
      {.by_state = normals.jacobian,
       .by_field = ByField(bundle, normals.jacobian.rows()),
       .residuals = Eigen::Map<const Eigen::VectorXd>(residuals.data(), std::ssize(residuals)),
       .clusters = normals.clusters,
       .covariance_times = times,
       .root_times = root_times},
      {.noise = common_errors, .pulls{}});
  if (!found) return std::nullopt;
  return found->sigma * normals.scale.asDiagonal() * found->motion;
}

}  // namespace

absl::Status EnlargeByCommonErrors(Bundle& bundle) {
  constexpr double kExcess = 1.3;  // less is chance
  const absl::Status unknown = FailedPrecondition(
      "how uncertain the poses are cannot be found, as the data hardly determine them; add frames "
      "with the flange turned about other axes");
  std::optional<BundleJacobian> derivatives = JacobianOf(bundle);
  if (!derivatives) return unknown;
  Normals normals{
      .derivatives = *std::move(derivatives), .scale{}, .jacobian{}, .solver{}, .clusters{}};
  const auto& jacobian = normals.derivatives.jacobian;
  normals.scale.resize(jacobian.cols());
  for (int i = 0; i < jacobian.cols(); ++i) normals.scale[i] = 1 / jacobian.col(i).norm();
  normals.jacobian = jacobian * normals.scale.asDiagonal();
  normals.solver.compute(
      Eigen::SparseMatrix<double>(normals.jacobian.transpose() * normals.jacobian));
  if (normals.solver.info() != Eigen::Success) return unknown;
  normals.clusters = Clusters(bundle, normals.derivatives, normals.jacobian);
  const std::optional<double> found = CommonErrors(bundle, normals);
  if (!found) return unknown;
  const double factor = *found > kExcess ? *found : 1;
  const std::optional<Eigen::MatrixXd> by_field = MotionByField(bundle, normals, factor);
  for (const BundleBlock& block : normals.derivatives.blocks) {
    const auto moved = by_field ? Eigen::MatrixXd(by_field->middleRows(block.column, block.width()))
                                : Eigen::MatrixXd::Zero(block.width(), 1);
    const Eigen::MatrixXd added = moved * moved.transpose();
    if (block.pose) {
      block.pose->covariance = factor * block.pose->covariance + added;
    } else {
      double& sigma = bundle.size_sigmas[static_cast<size_t>(block.size)];
      sigma = std::sqrt(factor * sigma * sigma + added(0, 0));
    }
  }
  return absl::OkStatus();
}

}  // namespace silhouette
