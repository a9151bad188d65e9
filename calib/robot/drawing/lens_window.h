// SPDX-License-Identifier: Apache-2.0
// LensWindow: which directions a view's image shows, at z = 1 of the camera's frame, and how its
// lens bends lines there. Uses the standard library and Eigen alone.
//
// A value; used by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calib/camera/camera_model.h"

namespace silhouette {

class LensWindow {
 public:
  // Of all that the image of `camera` may show if it shows points up to `margin` pixels away from
  // where the model does, and a little more.
  LensWindow(const CameraModel& camera, double margin);

  // Cuts off a convex outline what is beyond the window. `room`: for the work.
  void Clip(std::vector<Eigen::Vector2d>& outline, std::vector<Eigen::Vector2d>& room) const;

  // Whether the window holds all that is between two corners of a box.
  bool Holds(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const;

  // A box about the window.
  const Eigen::AlignedBox2d& box() const { return box_; }
  // Of the circle within the window, which is a polygon about it; 0: the window is the box.
  double radius() const { return radius_; }
  // Whether the lens folds nowhere in the window, so that each pixel shows one direction of it.
  bool clear_of_fold() const { return clear_of_fold_; }

  // In the window, for a step of 1 at z = 1: pixels by which the image of a line moves at most, and
  // pixels by which it bends at most (second derivative). Not finite: the lens cannot be bounded.
  double scale() const { return scale_; }
  double bend() const { return bend_; }
  double stretch() const { return stretch_; }  // as scale, without a margin between samples
  double shrink() const { return shrink_; }    // pixels by which it moves at least

 private:
  // x * normal <= offset
  struct HalfPlane {
    Eigen::Vector2d normal;
    double offset;
  };

  void Find(const CameraModel& camera, double margin);
  bool NothingBeyond(const CameraModel& camera, double widest, double margin) const;
  void BoundLens(const CameraModel& camera);

  std::vector<HalfPlane> sides_;  // of a convex region with all that the image shows
  Eigen::AlignedBox2d box_;
  double radius_ = 0;
  bool clear_of_fold_ = true;
  double scale_ = 0;
  double bend_ = 0;
  double stretch_ = 0;
  double shrink_ = 0;
};

// The pixel coordinate at which the image shows (p.x, p.y, 1) of the camera's frame; its fold is
// not checked.
inline Eigen::Vector2d PixelAt(const CameraIntrinsics& in, const Eigen::Vector2d& p) {
  const Eigen::Vector2d distorted = Distort(in, p.x(), p.y());
  return {in.fx * distorted.x() + in.cx, in.fy * distorted.y() + in.cy};
}

// The same for many points at once, as numbers or vectors of them, with the `lens` that Distort
// has.
template <typename Lens, typename T>
inline void DistortLanes(const Lens* lens, bool rational, const T& u, const T& v, T& to_u,
                         T& to_v) {
  const T r2 = u * u + v * v;
  const T uv = u * v;
  T radial = 1 + r2 * (lens[0] + r2 * (lens[1] + r2 * lens[4]));
  if (rational) radial /= 1 + r2 * (lens[5] + r2 * (lens[6] + r2 * lens[7]));
  to_u = u * radial + 2 * lens[2] * uv + lens[3] * (r2 + 2 * u * u);
  to_v = v * radial + lens[2] * (r2 + 2 * v * v) + 2 * lens[3] * uv;
}

// What the image shows at a pixel coordinate, at z = 1; not numbers: no ray is seen there.
Eigen::Vector2d AtOneMetre(const CameraModel& camera, const Eigen::Vector2d& pixel);

}  // namespace silhouette
