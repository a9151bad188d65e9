// SPDX-License-Identifier: Apache-2.0
// The bundle's residuals, for Ceres to derive. For pose_bundle.cc alone.
//
// A pose is sought as reference * motion, the motion a rotation vector and a translation.
#pragma once

#include <ceres/rotation.h>

#include <Eigen/Geometry>

#include "calib/poses/pose_bundle.h"

namespace silhouette {

// Of a board's size factor about 1.
inline constexpr double kSizeSigma = 0.2;

struct Frame {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
};

inline Frame FrameOf(const Eigen::Isometry3d& pose) {
  return {Eigen::Quaterniond(pose.linear()).normalized(), pose.translation()};
}

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

// reference * motion * point
template <typename T>
Vector3<T> Apply(const Frame& reference, const T* motion, const Vector3<T>& point) {
  Vector3<T> moved;
  ceres::AngleAxisRotatePoint(motion, point.data(), moved.data());
  moved += Eigen::Map<const Vector3<T>>(motion + 3);
  return reference.rotation.cast<T>() * moved + reference.translation.cast<T>();
}

// (reference * motion)^-1 * point
template <typename T>
Vector3<T> ApplyInverse(const Frame& reference, const T* motion, const Vector3<T>& point) {
  const Vector3<T> moved =
      reference.rotation.conjugate().cast<T>() * (point - reference.translation.cast<T>()) -
      Eigen::Map<const Vector3<T>>(motion + 3);
  const T back[3] = {-motion[0], -motion[1], -motion[2]};
  Vector3<T> result;
  ceres::AngleAxisRotatePoint(back, moved.data(), result.data());
  return result;
}

// Of r^2 at z = 1: further out (85 degrees) no lens of this model sees.
inline constexpr double kLargestRadius2 = 144;

// As CameraModel::Project, for the camera's frame. False behind the camera and far aside.
template <typename T>
bool Project(const CameraIntrinsics& lens, const Vector3<T>& point, T* pixel) {
  if (!(point.z() > T(1e-6))) return false;
  const T x = point.x() / point.z();
  const T y = point.y() / point.z();
  if (!(x * x + y * y < T(kLargestRadius2))) return false;
  const Eigen::Matrix<T, 2, 1> distorted = Distort(lens, x, y);
  pixel[0] = lens.fx * distorted.x() + lens.cx;
  pixel[1] = lens.fy * distorted.y() + lens.cy;
  return true;
}

// The residual of a corner, in sigmas. What is constant of a corner's chain.
struct CornerCost {
  const CameraIntrinsics& lens;
  const BundleCorner& corner;
  Frame camera;
  Frame flange;
  Frame board;

  // Blocks: camera, board, size.
  template <typename T>
  bool operator()(const T* camera_motion, const T* board_motion, const T* size, T* residual) const {
    return Finish(camera_motion, InWorld(board_motion, size), residual);
  }

  // Blocks: camera, board, size, flange.
  template <typename T>
  bool operator()(const T* camera_motion, const T* board_motion, const T* size,
                  const T* flange_motion, T* residual) const {
    const Vector3<T> point = InWorld(board_motion, size);
    return Finish(camera_motion,
                  corner.camera_on_flange ? ApplyInverse(flange, flange_motion, point)
                                          : Apply(flange, flange_motion, point),
                  residual);
  }

 private:
  template <typename T>
  Vector3<T> InWorld(const T* board_motion, const T* size) const {
    return Apply<T>(board, board_motion, corner.point.cast<T>() * size[0]);
  }
  template <typename T>
  bool Finish(const T* camera_motion, const Vector3<T>& point, T* residual) const {
    if (!Project(lens, Apply(camera, camera_motion, point), residual)) return false;
    residual[0] = (residual[0] - corner.pixel.x()) / corner.sigma;
    residual[1] = (residual[1] - corner.pixel.y()) / corner.sigma;
    return true;
  }
};

struct MotionPrior {
  double rotation_sigma;
  double position_sigma;

  template <typename T>
  bool operator()(const T* motion, T* residual) const {
    for (int i = 0; i < 3; ++i) {
      residual[i] = motion[i] / rotation_sigma;
      residual[i + 3] = motion[i + 3] / position_sigma;
    }
    return true;
  }
};

struct SizePrior {
  template <typename T>
  bool operator()(const T* size, T* residual) const {
    residual[0] = (size[0] - T(1)) / kSizeSigma;
    return true;
  }
};

}  // namespace silhouette
