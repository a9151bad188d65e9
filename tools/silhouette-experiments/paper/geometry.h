// SPDX-License-Identifier: Apache-2.0
// The paper's simulation (§4.1, Figure 6): a robot of two links, each of equidistant spheres, and
// cameras by parallel projection onto a plane. Plain values.
//
// The robot's base is the origin, z is up; at joint values 0 both links point along +x. An image
// shows the window [-half_width, half_width]^2 of the plane through the origin; its columns run
// along `right`, its rows against `up`. Mask pixels: integers at pixel centres, as in
// calib/camera/camera_model.h.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "calib/camera/calibration.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"

namespace silhouette::paper {

// Robot and obstacles are made of spheres.
struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0;
};

using Spheres = std::vector<Sphere>;

// The truth: whether any sphere of `a` and any of `b` have a point in common.
inline bool Touch(std::span<const Sphere> a, std::span<const Sphere> b) {
  for (const Sphere& each : a) {
    for (const Sphere& other : b) {
      const double reach = each.radius + other.radius;
      if ((each.centre - other.centre).squaredNorm() <= reach * reach) return true;
    }
  }
  return false;
}

enum class Variant {
  // Both axes are parallel to y, the arm moves in the x-z plane; positive values lift the links.
  // The second value counts from the first link's direction.
  kPlanar,
  // The first axis is z; the first link stays level. The second joint pitches the second link:
  // positive values lift it.
  kSpatial,
};

std::string NameOf(Variant variant);

struct ArmShape {
  std::array<double, 2> links{0.45, 0.45};  // lengths
  int spheres_per_link = 5;                 // at least 2; the first and last are at the link's ends
  double sphere_radius = 0.07;
};

// The spheres of both links, from the base outward, at joint values q1, q2 in radians.
Spheres ArmAt(const ArmShape& shape, Variant variant, double q1, double q2);

// Two continuous joints of `steps` values each, from 0.
ConfigurationGrid ArmGrid(int steps);

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
