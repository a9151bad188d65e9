// SPDX-License-Identifier: Apache-2.0
#include <Eigen/SparseCholesky>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "calib/poses/pose_bundle.h"

namespace silhouette {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// With the diagonal scaled to one, a pivot is the share of a parameter's effect that the others
// cannot imitate; below this it is rounding.
constexpr double kLeastPivot = 1e-11;

std::string NameAt(const std::vector<BundleBlock>& blocks, Eigen::Index column) {
  for (const BundleBlock& block : blocks) {
    if (block.pose && column >= block.column && column < block.column + 6) return block.pose->name;
  }
  return "the boards' size";
}

// The priors' sum of squares, and its expectation.
void SumPriors(const std::vector<BundlePose>& poses, double& chi2, double& redundancy) {
  for (const BundlePose& pose : poses) {
    if (!pose.has_prior || pose.left_out || pose.constant || pose.covariance.isZero(0)) continue;
    chi2 += pose.PriorResidual().squaredNorm();
    for (int i = 0; i < 6; ++i) {
      const double sigma = i < 3 ? pose.rotation_sigma : pose.position_sigma;
      redundancy += 1 - pose.covariance(i, i) / (sigma * sigma);
    }
  }
}

// Of each part's used corners, whose rows come first, two each: the squares of their derivatives.
std::vector<Sparse> NormalsOfParts(const Bundle& bundle, const Sparse& jacobian) {
  if (bundle.parts.empty()) return {};
  std::vector<std::vector<Eigen::Triplet<double>>> rows(bundle.parts.size());
  std::vector<int> part_of_row;
  for (const BundleCorner& corner : bundle.corners) {
    if (corner.used) part_of_row.insert(part_of_row.end(), 2, corner.part);
  }
  for (int column = 0; column < jacobian.cols(); ++column) {
    for (Sparse::InnerIterator entry(jacobian, column); entry; ++entry) {
      const auto row = static_cast<size_t>(entry.row());
      if (row >= part_of_row.size()) continue;
      rows[part_of_row[row]].emplace_back(entry.row(), column, entry.value());
    }
  }
  std::vector<Sparse> normals;
  for (const auto& entries : rows) {
    Sparse part(jacobian.rows(), jacobian.cols());
    part.setFromTriplets(entries.begin(), entries.end());
    normals.emplace_back(part.transpose() * part);
  }
  return normals;
}

void SumParts(const Bundle& bundle, BundleStatistics& statistics) {
  statistics.part_chi2.assign(bundle.parts.size(), 0);
  statistics.part_redundancy.assign(bundle.parts.size(), 0);
  if (bundle.parts.empty()) return;
  for (const BundleCorner& corner : bundle.corners) {
    if (!corner.used) continue;
    statistics.part_chi2[corner.part] += (corner.residual / corner.sigma).squaredNorm();
    statistics.part_redundancy[corner.part] += 2;
  }
}

}  // namespace

BundleStatistics FindCovariances(Bundle& bundle) {
  bundle.size_sigmas.assign(bundle.sizes.size(), 0);
  for (auto* poses : {&bundle.cameras, &bundle.flanges, &bundle.board_poses}) {
    for (BundlePose& pose : *poses) pose.covariance.setZero();
  }
  BundleStatistics statistics;
  const std::optional<BundleJacobian> derivatives = JacobianOf(bundle);
  if (!derivatives) {
    statistics.undetermined = "anything";
    return statistics;
  }
  const Eigen::Index columns = derivatives->jacobian.cols();
  statistics.chi2 = derivatives->chi2;
  statistics.dof = static_cast<int>(derivatives->jacobian.rows() - columns);
  Eigen::VectorXd scale(columns);
  for (Eigen::Index i = 0; i < columns; ++i) {
    const double norm = derivatives->jacobian.col(i).norm();
    if (!(norm > 0)) {
      statistics.undetermined = NameAt(derivatives->blocks, i);
      return statistics;
    }
    scale[i] = 1 / norm;
  }
  const Sparse scaled = derivatives->jacobian * scale.asDiagonal();
  const Sparse normal = scaled.transpose() * scaled;
  const Eigen::SimplicialLDLT<Sparse> solver(normal);
  Eigen::Index least = 0;
  if (solver.info() != Eigen::Success) {
    statistics.undetermined = "a pose";
    return statistics;
  }
  if (!(solver.vectorD().minCoeff(&least) > kLeastPivot)) {
    statistics.undetermined =
        NameAt(derivatives->blocks, solver.permutationPinv().indices()[least]);
    return statistics;
  }
  SumParts(bundle, statistics);
  const std::vector<Sparse> parts = NormalsOfParts(bundle, scaled);
  for (const BundleBlock& block : derivatives->blocks) {
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(columns, block.width());
    unit.middleRows(block.column, block.width()).setIdentity();
    const Eigen::MatrixXd solved = solver.solve(unit);
    // What the unknowns take of the residuals: the trace of covariance and normal equations.
    for (size_t i = 0; i < parts.size(); ++i) {
      const Sparse taken = parts[i].middleCols(block.column, block.width());
      statistics.part_redundancy[i] -= taken.cwiseProduct(solved).sum();
    }
    const auto part = scale.segment(block.column, block.width()).asDiagonal();
    const Eigen::MatrixXd covariance = part * solved.middleRows(block.column, block.width()) * part;
    if (block.pose) {
      block.pose->covariance = (covariance + covariance.transpose()) / 2;
    } else {
      bundle.size_sigmas[block.size] = std::sqrt(covariance(0, 0));
    }
  }
  SumPriors(bundle.flanges, statistics.flange_chi2, statistics.flange_redundancy);
  SumPriors(bundle.board_poses, statistics.survey_chi2, statistics.survey_redundancy);
  return statistics;
}

}  // namespace silhouette
