#include "calib/fundamental/matrix_chart.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace silhouette {
namespace {

Eigen::Matrix3d Turn(const Eigen::Vector3d& by) {
  const double angle = by.norm();
  if (!(angle > 0)) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, by / angle).toRotationMatrix();
}

}  // namespace

Eigen::Matrix3d NormalisingOf(std::span<const Correspondence> corners,
                              Eigen::Vector2d Correspondence::*point) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Correspondence& corner : corners) mean += corner.*point;
  mean /= static_cast<double>(corners.size());
  double length = 0;
  for (const Correspondence& corner : corners) length += (corner.*point - mean).norm();
  const double scale =
      std::sqrt(2.0) * static_cast<double>(corners.size()) / std::max(length, 1e-9);
  Eigen::Matrix3d normalising;
  normalising << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return normalising;
}

MatrixChart::MatrixChart(const Eigen::Matrix3d& f, const Eigen::Matrix3d& normal_a,
                         const Eigen::Matrix3d& normal_b)
    : normal_a_(normal_a), normal_b_(normal_b) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      normal_b.inverse().transpose() * f * normal_a.inverse(),
      Eigen::ComputeFullU | Eigen::ComputeFullV);
  u_ = svd.matrixU();
  v_ = svd.matrixV();
  ratio_ = std::atan2(svd.singularValues()[1], svd.singularValues()[0]);
}

Eigen::Matrix3d MatrixChart::At(const Freedoms& p) const {
  const double ratio = ratio_ + p[6];
  const Eigen::Vector3d values(std::cos(ratio), std::sin(ratio), 0);
  const Eigen::Matrix3d normal =
      u_ * Turn(p.head<3>()) * values.asDiagonal() * (v_ * Turn(p.segment<3>(3))).transpose();
  return normal_b_.transpose() * normal * normal_a_;
}

std::array<Eigen::Matrix3d, kMatrixFreedoms> MatrixChart::SlopesAt(const Freedoms& p) const {
  constexpr double kStep = 1e-6;
  std::array<Eigen::Matrix3d, kMatrixFreedoms> slopes;
  for (int k = 0; k < kMatrixFreedoms; ++k) {
    Freedoms more = p;
    Freedoms less = p;
    more[k] += kStep;
    less[k] -= kStep;
    slopes[static_cast<size_t>(k)] = (At(more) - At(less)) / (2 * kStep);
  }
  return slopes;
}

}  // namespace silhouette
