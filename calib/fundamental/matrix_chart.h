// The matrices of rank 2 around one of them, by seven numbers.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/matrix_fit.h"

namespace silhouette {

// Takes points to such of mean 0 and mean length sqrt 2.
Eigen::Matrix3d NormalisingOf(std::span<const Correspondence> corners,
                              Eigen::Vector2d Correspondence::*point);

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

}  // namespace silhouette
