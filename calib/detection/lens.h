// Lens: pixels as they are, and where they were if the camera had no distortion, so that straight
// edges are straight.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/camera/camera_model.h"

namespace silhouette {

class Lens {
 public:
  // Nothing is known of the camera: pixels stay where they are.
  Lens() = default;
  // Throws std::invalid_argument as CameraModel does.
  explicit Lens(const CameraIntrinsics& intrinsics);

  bool known() const { return camera_.has_value(); }

  // Nothing where the camera sees no ray.
  std::optional<Eigen::Vector2d> Undistorted(const Eigen::Vector2d& pixel) const;
  std::optional<Eigen::Vector2d> Distorted(const Eigen::Vector2d& undistorted) const;
  // How an undistorted position follows the pixel; the identity where that cannot be said.
  Eigen::Matrix2d UndistortedPerPixel(const Eigen::Vector2d& pixel) const;

 private:
  std::optional<CameraModel> camera_;  // in its own frame
};

}  // namespace silhouette
