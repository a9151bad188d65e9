#include "calib/fundamental/epipolar_geometry.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <stdexcept>

namespace silhouette {
namespace {

Eigen::Matrix3d PixelFromRay(const CameraIntrinsics& intrinsics) {
  Eigen::Matrix3d k;
  k << intrinsics.fx, 0, intrinsics.cx, 0, intrinsics.fy, intrinsics.cy, 0, 0, 1;
  return k;
}

Eigen::Matrix3d CrossWith(const Eigen::Vector3d& t) {
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  return cross;
}

// Takes pixel coordinates of an image of size `to` to those of one of size `from`.
Eigen::Matrix3d Scaling(PixelSize from, PixelSize to) {
  const double sx = static_cast<double>(from.width) / to.width;
  const double sy = static_cast<double>(from.height) / to.height;
  Eigen::Matrix3d scaling;
  scaling << sx, 0, 0.5 * sx - 0.5, 0, sy, 0.5 * sy - 0.5, 0, 0, 1;
  return scaling;
}

// x_b' F x_a, and how steeply it grows in each image.
struct Algebraic {
  double error = 0;
  double slope_a = 0;
  double slope_b = 0;
};

Algebraic AlgebraicError(const Eigen::Matrix3d& f, const Eigen::Vector2d& a,
                         const Eigen::Vector2d& b) {
  const Eigen::Vector3d line_in_b = f * a.homogeneous();
  const Eigen::Vector3d line_in_a = f.transpose() * b.homogeneous();
  return {.error = line_in_b.dot(b.homogeneous()),
          .slope_a = line_in_a.head<2>().norm(),
          .slope_b = line_in_b.head<2>().norm()};
}

}  // namespace

Eigen::Matrix3d FundamentalBetween(const CameraModel& a, const CameraModel& b) {
  const Eigen::Isometry3d b_from_a = b.camera_from_world() * a.camera_from_world().inverse();
  if (!(b_from_a.translation().norm() > 1e-9)) {
    throw std::invalid_argument("two cameras stand at the same place");
  }
  const Eigen::Matrix3d f = PixelFromRay(b.intrinsics()).inverse().transpose() *
                            CrossWith(b_from_a.translation()) * b_from_a.linear() *
                            PixelFromRay(a.intrinsics()).inverse();
  return f / f.norm();
}

Eigen::Matrix3d ScaledTo(const Eigen::Matrix3d& f, PixelSize from_a, PixelSize to_a,
                         PixelSize from_b, PixelSize to_b) {
  return Scaling(from_b, to_b).transpose() * f * Scaling(from_a, to_a);
}

Eigen::Vector2d ScaledTo(const Eigen::Vector2d& point, PixelSize from, PixelSize to) {
  return {(point.x() + 0.5) * to.width / from.width - 0.5,
          (point.y() + 0.5) * to.height / from.height - 0.5};
}

EpipolarDistance DistanceBetween(const Eigen::Matrix3d& f, const Eigen::Vector2d& a,
                                 const Eigen::Vector2d& b) {
  const Algebraic at = AlgebraicError(f, a, b);
  return {.in_a = std::abs(at.error) / at.slope_a, .in_b = std::abs(at.error) / at.slope_b};
}

// A margin m widens the angles of the squares by m times the angle per pixel, which is a slope
// times the same factor in both images; together they must make up for the error.
double NeededMargin(const Eigen::Matrix3d& f, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Algebraic at = AlgebraicError(f, a, b);
  return std::abs(at.error) / (at.slope_a + at.slope_b);
}

double SampsonDistance(const Eigen::Matrix3d& f, const Eigen::Vector2d& a, double sigma_a,
                       const Eigen::Vector2d& b, double sigma_b) {
  const Algebraic at = AlgebraicError(f, a, b);
  return at.error / std::hypot(sigma_a * at.slope_a, sigma_b * at.slope_b);
}

}  // namespace silhouette
