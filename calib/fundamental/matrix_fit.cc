#include "calib/fundamental/matrix_fit.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>
#include <unsupported/Eigen/NonLinearOptimization>

#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/matrix_chart.h"

namespace silhouette {
namespace {

using Freedoms = MatrixChart::Freedoms;

// Sampson's distances of all corners, as Eigen's minimiser asks for them.
struct MatrixFitDistances {
  using Scalar = double;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };
  using InputType = Eigen::VectorXd;
  using ValueType = Eigen::VectorXd;
  using JacobianType = Eigen::MatrixXd;

  const MatrixChart& chart;
  std::span<const Correspondence> corners;

  int inputs() const { return kMatrixFreedoms; }
  int values() const { return static_cast<int>(corners.size()); }

  int operator()(const Freedoms& p, Eigen::VectorXd& distances) const {
    const Eigen::Matrix3d f = chart.At(p);
    for (size_t i = 0; i < corners.size(); ++i) {
      const Correspondence& c = corners[i];
      distances[static_cast<Eigen::Index>(i)] = SampsonDistance(f, c.a, c.sigma_a, c.b, c.sigma_b);
    }
    return 0;
  }

  int df(const Freedoms& p, Eigen::MatrixXd& jacobian) const {
    const Eigen::Matrix3d f = chart.At(p);
    const auto slopes = chart.SlopesAt(p);
    for (size_t i = 0; i < corners.size(); ++i) {
      const Correspondence& c = corners[i];
      const Eigen::Vector3d a = c.a.homogeneous();
      const Eigen::Vector3d b = c.b.homogeneous();
      const Eigen::Vector2d line_a = c.sigma_a * (f.transpose() * b).head<2>();
      const Eigen::Vector2d line_b = c.sigma_b * (f * a).head<2>();
      const double length = std::sqrt(line_a.squaredNorm() + line_b.squaredNorm());
      const double distance = b.dot(f * a) / length;
      for (size_t k = 0; k < slopes.size(); ++k) {
        const Eigen::Vector3d slope_b = slopes[k] * a;
        const Eigen::Vector3d slope_a = slopes[k].transpose() * b;
        const double longer = (c.sigma_a * line_a.dot(slope_a.head<2>()) +
                               c.sigma_b * line_b.dot(slope_b.head<2>())) /
                              length;
        jacobian(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
            (b.dot(slope_b) - distance * longer) / length;
      }
    }
    return 0;
  }
};

}  // namespace

double MatrixFit::MarginDeviation(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  const Eigen::Vector3d x = a.homogeneous();
  const Eigen::Vector3d y = b.homogeneous();
  Eigen::Matrix<double, kMatrixFreedoms, 1> slope;
  for (int k = 0; k < kMatrixFreedoms; ++k) slope[k] = y.dot(slopes[static_cast<size_t>(k)] * x);
  const double steepness = (f * x).head<2>().norm() + (f.transpose() * y).head<2>().norm();
  return std::sqrt(std::max(0.0, slope.dot(covariance * slope))) / steepness;
}

Eigen::Matrix3d EightPoints(std::span<const Correspondence> corners) {
  const Eigen::Matrix3d normal_a = NormalisingOf(corners, &Correspondence::a);
  const Eigen::Matrix3d normal_b = NormalisingOf(corners, &Correspondence::b);
  Eigen::Matrix<double, 9, 9> squares = Eigen::Matrix<double, 9, 9>::Zero();
  for (const Correspondence& corner : corners) {
    const Eigen::Vector3d a = normal_a * corner.a.homogeneous();
    const Eigen::Vector3d b = normal_b * corner.b.homogeneous();
    Eigen::Matrix<double, 9, 1> row;
    row << b.x() * a, b.y() * a, b.z() * a;
    squares.selfadjointView<Eigen::Lower>().rankUpdate(row);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(squares);
  const Eigen::Matrix<double, 9, 1> least = solver.eigenvectors().col(0);
  Eigen::Matrix3d normal;
  normal << least.head<3>().transpose(), least.segment<3>(3).transpose(),
      least.tail<3>().transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(normal, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d values = svd.singularValues();
  values[2] = 0;
  const Eigen::Matrix3d f = normal_b.transpose() * svd.matrixU() * values.asDiagonal() *
                            svd.matrixV().transpose() * normal_a;
  return f / f.norm();
}

MatrixFit Refined(const Eigen::Matrix3d& start, std::span<const Correspondence> corners) {
  const MatrixChart chart(start, NormalisingOf(corners, &Correspondence::a),
                          NormalisingOf(corners, &Correspondence::b));
  MatrixFitDistances distances{chart, corners};
  Freedoms p = Freedoms::Zero(kMatrixFreedoms);
  Eigen::LevenbergMarquardt<MatrixFitDistances> minimiser(distances);
  minimiser.parameters.maxfev = 200;
  minimiser.minimize(p);

  Eigen::MatrixXd jacobian(distances.values(), kMatrixFreedoms);
  distances.df(p, jacobian);
  MatrixFit fit{.f = chart.At(p), .slopes = chart.SlopesAt(p), .covariance = {}};
  const MatrixCovariance information = jacobian.transpose() * jacobian;
  fit.covariance = information.completeOrthogonalDecomposition().pseudoInverse();
  const double norm = fit.f.norm();
  fit.f /= norm;
  for (Eigen::Matrix3d& slope : fit.slopes) slope /= norm;
  return fit;
}

}  // namespace silhouette
