// SPDX-License-Identifier: Apache-2.0
// CameraModel: where a world point appears in a view's image, and which ray a pixel sees. Part of
// the pure core.
//
// Pinhole with OpenCV's distortion. An integer coordinate is a pixel's centre, x to the right, y
// down: the image covers [-0.5, width - 0.5] x [-0.5, height - 0.5]. The camera's frame has z along
// the view, x to the right, y down. A pose `a_from_b` takes points in b to points in a. Metres and
// pixels. A model cannot be changed once made and can be read by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <vector>

namespace silhouette {

struct CameraIntrinsics {
  int width = 0;  // pixels
  int height = 0;
  double fx = 0;  // focal lengths, pixels
  double fy = 0;
  double cx = 0;  // principal point, pixels
  double cy = 0;
  // k1, k2, p1, p2, k3, k4, k5, k6: radial (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 +
  // k6 r^6), tangential p1, p2, in OpenCV's order. The five-parameter form leaves k4..k6 at 0.
  std::array<double, 8> distortion{};
};

// Where the distortion takes the point (x, y, 1) of the camera's frame, at z = 1; its fold is not
// checked. T: double, or a type that carries derivatives.
template <typename T>
Eigen::Matrix<T, 2, 1> Distort(const CameraIntrinsics& intrinsics, const T& x, const T& y) {
  const auto& d = intrinsics.distortion;
  const T r2 = x * x + y * y;
  const T xy = x * y;
  const T radial = (T(1) + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) /
                   (T(1) + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
  return {x * radial + T(2 * d[2]) * xy + T(d[3]) * (r2 + T(2) * x * x),
          y * radial + T(d[2]) * (r2 + T(2) * y * y) + T(2 * d[3]) * xy};
}

// The same camera's intrinsics for an image of `width` x `height` that shows the same field, such
// as the mask made from the image.
CameraIntrinsics ScaledTo(const CameraIntrinsics& intrinsics, int width, int height);

// A pose by its rotation vector (axis times angle, radians) and translation.
Eigen::Isometry3d PoseOf(const Eigen::Vector3d& rotation_vector,
                         const Eigen::Vector3d& translation);
Eigen::Vector3d RotationVectorOf(const Eigen::Isometry3d& pose);
// How a point moves with a small motion of the space it is in: rotation vector, translation.
Eigen::Matrix<double, 3, 6> DerivativeByMotion(const Eigen::Vector3d& point);

class CameraModel {
 public:
  // Throws std::invalid_argument unless width, height, fx and fy are positive and all is finite.
  CameraModel(const CameraIntrinsics& intrinsics, const Eigen::Isometry3d& camera_from_world);
  // In its own frame.
  explicit CameraModel(const CameraIntrinsics& intrinsics)
      : CameraModel(intrinsics, Eigen::Isometry3d::Identity()) {}

  const CameraIntrinsics& intrinsics() const { return intrinsics_; }
  const Eigen::Isometry3d& camera_from_world() const { return camera_from_world_; }

  // The same camera with images of `width` x `height`.
  CameraModel ScaledTo(int width, int height) const;

  // The camera's centre in the world.
  Eigen::Vector3d Centre() const;

  // The pixel coordinates of a point, inside the image or not. Nothing if the point is behind the
  // camera or so far out that the distortion folds back.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& point_in_world) const;

  // The direction, unit length in the world, in which the camera sees a pixel coordinate. Nothing
  // where no ray is seen (beyond the distortion's fold).
  std::optional<Eigen::Vector3d> Ray(const Eigen::Vector2d& pixel) const;

  // Where a camera without distortion, otherwise the same, would see what this one sees at `pixel`,
  // and the way back; nothing beyond the distortion's fold.
  std::optional<Eigen::Vector2d> Undistorted(const Eigen::Vector2d& pixel) const;
  std::optional<Eigen::Vector2d> Distorted(const Eigen::Vector2d& undistorted) const;

  // The distance from the axis, at z = 1, where the radial distortion folds back: nothing is seen
  // from there on. Infinity if it does not.
  double FoldRadius() const { return fold_; }

  // Whether a pixel coordinate lies on the image.
  bool Contains(const Eigen::Vector2d& pixel) const;

 private:
  // Between undistorted coordinates at z = 1, in the camera's frame, and pixels.
  std::optional<Eigen::Vector2d> PixelOf(const Eigen::Vector2d& at_one_metre) const;
  std::optional<Eigen::Vector2d> AtOneMetre(const Eigen::Vector2d& pixel) const;

  CameraIntrinsics intrinsics_;
  Eigen::Isometry3d camera_from_world_;
  double fold_ = 0;  // least radius, at z = 1, where the radial distortion stops growing
};

// A lattice of points all over a box, with `steps` steps from side to side along each axis.
std::vector<Eigen::Vector3d> PointsOf(const Eigen::AlignedBox3d& box, int steps);

// The largest distance in the image, in pixels, that a metre between two near points of `box` can
// have, as far as the image shows the box: from the largest singular value of the projection's
// derivative, on a lattice of points and at the point nearest to the camera. 0 if the image shows
// nothing of the box; nothing if the camera is in the box, or on its rim.
std::optional<double> PixelsPerMetre(const CameraModel& camera, const Eigen::AlignedBox3d& box);

}  // namespace silhouette
