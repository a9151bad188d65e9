// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "calib/poses/pose_bundle.h"

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

// How many times larger the variance of the cameras' poses is than by independent errors; 1 if that
// is not known.
double CommonErrors(Bundle& bundle) {
  const std::optional<BundleJacobian> derivatives = JacobianOf(bundle);
  if (!derivatives) return 1;
  RowMajor jacobian = derivatives->jacobian;
  Eigen::VectorXd scale(jacobian.cols());
  for (int i = 0; i < jacobian.cols(); ++i) scale[i] = 1 / derivatives->jacobian.col(i).norm();
  jacobian = jacobian * scale.asDiagonal();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(
      Eigen::SparseMatrix<double>(jacobian.transpose() * jacobian));
  if (solver.info() != Eigen::Success) return 1;
  // Of the state on each camera's pose, that in directions of variance 1. Not of all cameras
  // together: how they stand to each other is known far better than where they stand.
  std::vector<Eigen::MatrixXd> of_cameras;
  for (const BundleBlock& block : derivatives->blocks) {
    const bool camera = std::ranges::any_of(
        bundle.cameras, [&](const BundlePose& pose) { return &pose == block.pose; });
    if (!camera) continue;
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(jacobian.cols(), 6);
    unit.middleRows<6>(block.column).setIdentity();
    const Eigen::MatrixXd solved = solver.solve(unit);
    const Eigen::LLT<Eigen::MatrixXd> covariance(solved.middleRows<6>(block.column));
    if (covariance.info() != Eigen::Success) return 1;
    of_cameras.emplace_back(covariance.matrixL().solve(solved.transpose()).transpose());
  }
  if (of_cameras.empty()) return 1;
  Eigen::MatrixXd influence(jacobian.cols(), 6 * std::ssize(of_cameras));
  for (size_t i = 0; i < of_cameras.size(); ++i) {
    influence.middleCols<6>(static_cast<Eigen::Index>(6 * i)) = of_cameras[i];
  }

  double found = 0;
  double expected = 0;
  for (const std::vector<int>& rows : Clusters(bundle, *derivatives, jacobian)) {
    Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(jacobian.cols(), influence.cols());
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(influence.cols());
    for (const int row : rows) {
      const Eigen::RowVectorXd by_row = jacobian.row(row) * influence;
      pull += by_row.transpose() * derivatives->residuals[static_cast<size_t>(row)];
      expected += by_row.squaredNorm();
      for (RowMajor::InnerIterator entry(jacobian, row); entry; ++entry) {
        squares.row(entry.col()) += entry.value() * by_row;
      }
    }
    found += pull.squaredNorm();
    // The solution has followed each cluster by its share.
    expected -= squares.cwiseProduct(solver.solve(squares)).sum();
  }
  return expected > 0 ? found / expected : 1;
}

}  // namespace

void EnlargeByCommonErrors(Bundle& bundle) {
  constexpr double kExcess = 1.3;  // less is chance
  const double factor = CommonErrors(bundle);
  if (!(factor > kExcess) || !std::isfinite(factor)) return;
  for (auto* poses : {&bundle.cameras, &bundle.flanges, &bundle.board_poses}) {
    for (BundlePose& pose : *poses) pose.covariance *= factor;
  }
  for (double& sigma : bundle.size_sigmas) sigma *= std::sqrt(factor);
}

}  // namespace silhouette
