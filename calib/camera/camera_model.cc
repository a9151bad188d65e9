// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_model.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace silhouette {
namespace {

// The radial factor of OpenCV's model for r^2.
double RadialFactor(const std::array<double, 8>& d, double r2) {
  const double above = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  const double below = 1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7]));
  return above / below;
}

// The derivative of RadialFactor by r^2.
double RadialSlope(const std::array<double, 8>& d, double r2) {
  const double above = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  const double below = 1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7]));
  const double above_slope = d[0] + r2 * (2 * d[1] + r2 * 3 * d[4]);
  const double below_slope = d[5] + r2 * (2 * d[6] + r2 * 3 * d[7]);
  return (above_slope * below - above * below_slope) / (below * below);
}

// The least r at which r * RadialFactor(r^2) stops growing; infinity if it grows up to the widest
// angle that a pinhole image can sensibly show.
double FirstFold(const std::array<double, 8>& d) {
  constexpr int kSteps = 12000;  // up to 85 degrees off the axis
  constexpr double kStep = 1e-3;
  for (int i = 1; i < kSteps; ++i) {
    const double r = i * kStep;
    const double r2 = r * r;
    const double growth = RadialFactor(d, r2) + 2 * r2 * RadialSlope(d, r2);
    if (!(growth > 0)) return r - kStep;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

CameraIntrinsics ScaledTo(const CameraIntrinsics& intrinsics, int width, int height) {
  const double sx = static_cast<double>(intrinsics.width) / width;
  const double sy = static_cast<double>(intrinsics.height) / height;
  CameraIntrinsics scaled = intrinsics;
  scaled.width = width;
  scaled.height = height;
  scaled.fx = intrinsics.fx / sx;
  scaled.fy = intrinsics.fy / sy;
  scaled.cx = (intrinsics.cx + 0.5) / sx - 0.5;
  scaled.cy = (intrinsics.cy + 0.5) / sy - 0.5;
  return scaled;
}

Eigen::Isometry3d PoseOf(const Eigen::Vector3d& rotation_vector,
                         const Eigen::Vector3d& translation) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (const double angle = rotation_vector.norm(); angle > 0) {
    pose.linear() = Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
  }
  pose.translation() = translation;
  return pose;
}

Eigen::Vector3d RotationVectorOf(const Eigen::Isometry3d& pose) {
  const Eigen::AngleAxisd turn(pose.linear());
  return turn.angle() * turn.axis();
}

Eigen::Matrix<double, 3, 6> DerivativeByMotion(const Eigen::Vector3d& point) {
  Eigen::Matrix<double, 3, 6> derivative;
  derivative << 0, point.z(), -point.y(), 1, 0, 0,  //
      -point.z(), 0, point.x(), 0, 1, 0,            //
      point.y(), -point.x(), 0, 0, 0, 1;
  return derivative;
}

CameraModel::CameraModel(const CameraIntrinsics& intrinsics,
                         const Eigen::Isometry3d& camera_from_world)
    : intrinsics_(intrinsics), camera_from_world_(camera_from_world) {
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (intrinsics.width <= 0 || intrinsics.height <= 0) {
    throw std::invalid_argument("a camera's image has no pixels");
  }
  if (!positive(intrinsics.fx) || !positive(intrinsics.fy)) {
    throw std::invalid_argument("a camera's focal length must be positive");
  }
  if (!std::isfinite(intrinsics.cx) || !std::isfinite(intrinsics.cy) ||
      !std::ranges::all_of(intrinsics.distortion, [](double k) { return std::isfinite(k); }) ||
      !camera_from_world.matrix().allFinite()) {
    throw std::invalid_argument("a camera's parameters must be finite");
  }
  fold_ = FirstFold(intrinsics.distortion);
}

CameraModel CameraModel::ScaledTo(int width, int height) const {
  return {silhouette::ScaledTo(intrinsics_, width, height), camera_from_world_};
}

Eigen::Vector3d CameraModel::Centre() const { return camera_from_world_.inverse().translation(); }

std::optional<Eigen::Vector2d> CameraModel::Project(const Eigen::Vector3d& point_in_world) const {
  const Eigen::Vector3d point = camera_from_world_ * point_in_world;
  if (!(point.z() > 0)) return std::nullopt;
  return PixelOf(point.head<2>() / point.z());
}

std::optional<Eigen::Vector2d> CameraModel::PixelOf(const Eigen::Vector2d& at_one_metre) const {
  if (!(at_one_metre.norm() < fold_)) return std::nullopt;
  const Eigen::Vector2d p = Distort(intrinsics_, at_one_metre.x(), at_one_metre.y());
  return Eigen::Vector2d(intrinsics_.fx * p.x() + intrinsics_.cx,
                         intrinsics_.fy * p.y() + intrinsics_.cy);
}

std::optional<Eigen::Vector2d> CameraModel::AtOneMetre(const Eigen::Vector2d& pixel) const {
  const auto& d = intrinsics_.distortion;
  const Eigen::Vector2d target((pixel.x() - intrinsics_.cx) / intrinsics_.fx,
                               (pixel.y() - intrinsics_.cy) / intrinsics_.fy);
  // Newton's method; halved steps keep it on this side of the fold.
  Eigen::Vector2d p = target * std::min(1.0, 0.9 * fold_ / std::max(target.norm(), 1e-12));
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d error = Distort(intrinsics_, p.x(), p.y()) - target;
    if (error.norm() < 1e-14 * (1 + target.norm())) break;
    const double r2 = p.squaredNorm();
    const double radial = RadialFactor(d, r2);
    const double slope = 2 * RadialSlope(d, r2);
    Eigen::Matrix2d jacobian;
    jacobian(0, 0) = radial + slope * p.x() * p.x() + 2 * d[2] * p.y() + 6 * d[3] * p.x();
    jacobian(0, 1) = slope * p.x() * p.y() + 2 * d[2] * p.x() + 2 * d[3] * p.y();
    jacobian(1, 0) = jacobian(0, 1);
    jacobian(1, 1) = radial + slope * p.y() * p.y() + 6 * d[2] * p.y() + 2 * d[3] * p.x();
    const Eigen::Vector2d step = jacobian.inverse() * error;
    if (!step.allFinite()) return std::nullopt;
    double share = 1;
    while (share > 1e-6 && !((p - share * step).norm() < fold_)) share /= 2;
    p -= share * step;
  }
  if (!((Distort(intrinsics_, p.x(), p.y()) - target).norm() < 1e-9 * (1 + target.norm())) ||
      !(p.norm() < fold_)) {
    return std::nullopt;
  }
  return p;
}

std::optional<Eigen::Vector3d> CameraModel::Ray(const Eigen::Vector2d& pixel) const {
  const auto p = AtOneMetre(pixel);
  if (!p) return std::nullopt;
  return camera_from_world_.linear().transpose() * p->homogeneous().normalized();
}

std::optional<Eigen::Vector2d> CameraModel::Undistorted(const Eigen::Vector2d& pixel) const {
  const auto p = AtOneMetre(pixel);
  if (!p) return std::nullopt;
  return Eigen::Vector2d(intrinsics_.fx * p->x() + intrinsics_.cx,
                         intrinsics_.fy * p->y() + intrinsics_.cy);
}

std::optional<Eigen::Vector2d> CameraModel::Distorted(const Eigen::Vector2d& undistorted) const {
  return PixelOf({(undistorted.x() - intrinsics_.cx) / intrinsics_.fx,
                  (undistorted.y() - intrinsics_.cy) / intrinsics_.fy});
}

bool CameraModel::Contains(const Eigen::Vector2d& pixel) const {
  return pixel.x() >= -0.5 && pixel.x() <= intrinsics_.width - 0.5 && pixel.y() >= -0.5 &&
         pixel.y() <= intrinsics_.height - 0.5;
}

namespace {

constexpr int kLattice = 24;     // points along each edge of the box, less one
constexpr double kStep = 1e-5;   // metres
constexpr double kBeyond = 1.5;  // pixels: points this far outside the image count, too

// 0 where the image does not show the point.
double ScaleAt(const CameraModel& camera, const Eigen::Vector3d& point) {
  const auto pixel = camera.Project(point);
  const CameraIntrinsics& in = camera.intrinsics();
  if (!pixel || pixel->x() < -0.5 - kBeyond || pixel->x() > in.width - 0.5 + kBeyond ||
      pixel->y() < -0.5 - kBeyond || pixel->y() > in.height - 0.5 + kBeyond) {
    return 0;
  }
  Eigen::Matrix<double, 2, 3> derivative;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
    const auto before = camera.Project(point - step);
    const auto after = camera.Project(point + step);
    if (!before || !after) return 0;
    derivative.col(axis) = (*after - *before) / (2 * kStep);
  }
  return Eigen::JacobiSVD<Eigen::Matrix<double, 2, 3>>(derivative).singularValues()[0];
}

}  // namespace

std::vector<Eigen::Vector3d> PointsOf(const Eigen::AlignedBox3d& box, int steps) {
  std::vector<Eigen::Vector3d> points;
  for (int x = 0; x <= steps; ++x) {
    for (int y = 0; y <= steps; ++y) {
      for (int z = 0; z <= steps; ++z) {
        const Eigen::Vector3d share = Eigen::Vector3d(x, y, z) / steps;
        points.push_back(box.min() + share.cwiseProduct(box.sizes()));
      }
    }
  }
  return points;
}

std::optional<double> PixelsPerMetre(const CameraModel& camera, const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d centre = camera.Centre();
  const Eigen::Vector3d nearest = centre.cwiseMax(box.min()).cwiseMin(box.max());
  if ((nearest - centre).norm() < 1e-3) return std::nullopt;
  double greatest = ScaleAt(camera, nearest);
  for (const Eigen::Vector3d& point : PointsOf(box, kLattice)) {
    greatest = std::max(greatest, ScaleAt(camera, point));
  }
  return greatest;
}

}  // namespace silhouette
