// SPDX-License-Identifier: Apache-2.0
// Cameras of the paper's simulation: parallel projection onto a plane (§4.1).
//
// The image shows the window [-half_width, half_width]^2 of the plane through the origin; its
// columns run along `right`, its rows against `up`. Mask pixels: integers at pixel centres, as in
// calib/camera/camera_model.h. Cannot be changed once made.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "calib/camera/calibration.h"
#include "db/mask/mask.h"
#include "tools/silhouette-experiments/paper/arm.h"

namespace silhouette::paper {

class ParallelCamera {
 public:
  // `direction`: along which the camera looks, of any length but 0. `up` is z as the camera sees
  // it; for a camera that looks straight up or down it is y. Throws std::invalid_argument if the
  // direction is 0 or not finite, or half_width or pixels are not positive.
  ParallelCamera(const Eigen::Vector3d& direction, double half_width, int pixels);

  const Eigen::Vector3d& direction() const { return direction_; }
  const Eigen::Vector3d& right() const { return right_; }
  const Eigen::Vector3d& up() const { return up_; }
  MaskSize mask_size() const { return {pixels_, pixels_}; }
  double pixels_per_unit() const { return pixels_ / (2 * half_width_); }

  // Pixel coordinates of a point.
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const;

 private:
  Eigen::Vector3d direction_;
  Eigen::Vector3d right_;
  Eigen::Vector3d up_;
  double half_width_;
  int pixels_;
};

// The affine fundamental matrices of all pairs of cameras, a before b in the order given. Throws
// std::invalid_argument if two cameras look along the same line.
Calibration CalibrationOf(std::span<const ParallelCamera> cameras);

// When a mask pixel counts as covered.
enum class Raster {
  kCentre,  // its centre is
  kTouch,   // any point of its square is
};

std::string NameOf(Raster raster);

// The spheres as the camera sees them; what is outside the window is cut off.
Mask ImageOf(const ParallelCamera& camera, std::span<const Sphere> spheres, Raster raster);

}  // namespace silhouette::paper
