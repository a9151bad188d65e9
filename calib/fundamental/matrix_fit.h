// SPDX-License-Identifier: Apache-2.0
// A fundamental matrix fitted to corners of which none is wrong: eight points, then Sampson's
// distance at its least.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

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

// Takes points to such of mean 0 and mean length sqrt 2.
Eigen::Matrix3d NormalisingOf(std::span<const Correspondence> corners,
                              Eigen::Vector2d Correspondence::*point);

// The matrices of rank 2 around one of them, by seven numbers:
// U diag(cos r, sin r, 0) V' in normalised coordinates: U and V are turned, r changes.
class MatrixChart {
 public:
  using Freedoms = Eigen::VectorXd;  // kMatrixFreedoms of them, or more, which are not looked at

  MatrixChart(const Eigen::Matrix3d& f, const Eigen::Matrix3d& normal_a,
              const Eigen::Matrix3d& normal_b);

  // In pixels; the matrix that the chart was made of, but for its scale, at 0.
  Eigen::Matrix3d At(const Freedoms& p) const;
  std::array<Eigen::Matrix3d, kMatrixFreedoms> SlopesAt(const Freedoms& p) const;

 private:
  Eigen::Matrix3d normal_a_;
  Eigen::Matrix3d normal_b_;
  Eigen::Matrix3d u_;
  Eigen::Matrix3d v_;
  double ratio_ = 0;
};

// What Eigen's minimiser wants to know of a function with a value per corner.
struct CornerFunction {
  using Scalar = double;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };
  using InputType = Eigen::VectorXd;
  using ValueType = Eigen::VectorXd;
  using JacobianType = Eigen::MatrixXd;

  const MatrixChart& chart;
  std::span<const Correspondence> corners;

  int values() const { return static_cast<int>(corners.size()); }
};

// A fundamental matrix fitted to corners of which some are wrong.
struct RobustFit {
  MatrixFit fit;
  std::vector<bool> fits;     // per corner: whether it was believed
  std::vector<bool> roughly;  // whether it is right, though a lens may have moved it
  int believed = 0;
  // Root mean square of Sampson's distance of the believed corners; 1 if the corners' errors are
  // what they are said to be.
  double spread = 0;
};

// RANSAC over tags, then refined over the corners within four standard deviations - of what is
// found, if that is more than what the corners are said to have - until these stay the same. The
// same seed gives the same result. Nothing if there are less than eight corners or no eight of them
// agree with half of all.
std::optional<RobustFit> FitMatrix(std::span<const Correspondence> corners, uint32_t seed);

}  // namespace silhouette
