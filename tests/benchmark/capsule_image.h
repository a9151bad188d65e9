// SPDX-License-Identifier: Apache-2.0
// Capsules and their masks in pinhole views: the pictures of synthesised cells.
//
// Points in metres in the world's frame. A pixel (x, y) is the square [x, x + 1] x [y, y + 1] of
// the image. Masks are any-touch: a pixel is set if the capsule's picture touches its square.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>

#include "db/mask/mask.h"

namespace silhouette::benchmarks {

// All points within `radius` of the segment from `from` to `to`.
struct Capsule {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  double radius = 0;
};

// Distance of a point from the surface; negative inside.
double DistanceTo(const Capsule& capsule, const Eigen::Vector3d& point);

// A disc of an image, in pixels.
struct Disc {
  double x = 0;
  double y = 0;
  double radius = 0;
};

class PinholeView {
 public:
  // A camera at `centre` that looks at `target`, upright (z is up; not straight down or up).
  // `half_width`: tangent of half the horizontal field of view.
  PinholeView(const Eigen::Vector3d& centre, const Eigen::Vector3d& target, double half_width,
              MaskSize size);

  MaskSize size() const { return size_; }
  const Eigen::Vector3d& centre() const { return centre_; }

  // The picture of a ball: a disc about the picture of its centre with radius focal length * radius
  // / depth. (The true picture is an ellipse that is longer by less than 1 % at 10 degrees off the
  // axis.) What is drawn must be before the camera.
  Disc See(const Eigen::Vector3d& ball, double radius) const;

  // The world direction, unit length, of an image point.
  Eigen::Vector3d Ray(double x, double y) const;

 private:
  Eigen::Vector3d centre_;
  Eigen::Matrix3d camera_from_world_;  // rotation: x to the right, y down, z along the view
  double focal_ = 0;                   // pixels, along both axes
  MaskSize size_;
};

// Sets the pixels that the convex hull of two discs touches. `words`: those of a mask of `size`.
void DrawHull(const Disc& a, const Disc& b, MaskSize size, std::span<uint64_t> words);

// Sets the pixels of a capsule: the hull of the discs at its ends.
void Draw(const Capsule& capsule, const PinholeView& view, std::span<uint64_t> words);

// The mask of all capsules together.
Mask MaskOf(std::span<const Capsule> capsules, const PinholeView& view);

}  // namespace silhouette::benchmarks
