#include "calib/detection/lens.h"

namespace silhouette {

Lens::Lens(const CameraIntrinsics& intrinsics)
    : camera_(CameraModel(intrinsics, Eigen::Isometry3d::Identity())) {}

std::optional<Eigen::Vector2d> Lens::Undistorted(const Eigen::Vector2d& pixel) const {
  if (!camera_) return pixel;
  const std::optional<Eigen::Vector3d> ray = camera_->Ray(pixel);
  if (!ray || !(ray->z() > 0)) return std::nullopt;
  const CameraIntrinsics& k = camera_->intrinsics();
  return Eigen::Vector2d(k.fx * ray->x() / ray->z() + k.cx, k.fy * ray->y() / ray->z() + k.cy);
}

std::optional<Eigen::Vector2d> Lens::Distorted(const Eigen::Vector2d& undistorted) const {
  if (!camera_) return undistorted;
  const CameraIntrinsics& k = camera_->intrinsics();
  return camera_->Project({(undistorted.x() - k.cx) / k.fx, (undistorted.y() - k.cy) / k.fy, 1});
}

Eigen::Matrix2d Lens::UndistortedPerPixel(const Eigen::Vector2d& pixel) const {
  if (!camera_) return Eigen::Matrix2d::Identity();
  constexpr double kStep = 0.5;
  Eigen::Matrix2d result;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
    const auto before = Undistorted(pixel - step);
    const auto after = Undistorted(pixel + step);
    if (!before || !after) return Eigen::Matrix2d::Identity();
    result.col(axis) = (*after - *before) / (2 * kStep);
  }
  return result;
}

}  // namespace silhouette
