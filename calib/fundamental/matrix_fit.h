// A fundamental matrix fitted to corners of which none is wrong: eight points, then Sampson's
// distance at its least.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "calib/fundamental/correspondences.h"

namespace silhouette {

// What a matrix of rank 2 can be changed by: a turn of its left and of its right singular vectors,
// and the ratio of its singular values.
inline constexpr int kMatrixFreedoms = 7;
using MatrixCovariance = Eigen::Matrix<double, kMatrixFreedoms, kMatrixFreedoms>;

struct MatrixFit {
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();  // of rank 2
  // How f changes with each of its freedoms, and the freedoms' covariance if the corners have the
  // errors that they are said to have.
  std::array<Eigen::Matrix3d, kMatrixFreedoms> slopes{};
  MatrixCovariance covariance = MatrixCovariance::Zero();

  // Standard deviation of NeededMargin for points a and b that lie on each other's lines.
  double MarginDeviation(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
};

// The normalised eight-point algorithm (Hartley 1997): rank 2, of Frobenius norm 1. At least eight
// corners; not finite, or anything, if they are degenerate.
Eigen::Matrix3d EightPoints(std::span<const Correspondence> corners);

// From `start`, the matrix of rank 2 that makes the sum of squared Sampson distances least, by
// Levenberg and Marquardt.
MatrixFit Refined(const Eigen::Matrix3d& start, std::span<const Correspondence> corners);

}  // namespace silhouette
