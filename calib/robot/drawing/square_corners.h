// SPDX-License-Identifier: Apache-2.0
// SquareCorners: which pixels of a view lie within an outline for certain. Uses the standard
// library and Eigen alone.
//
// A value; used by any number of threads. 64 bytes a pixel.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "calib/camera/camera_model.h"

namespace silhouette {

class SquareCorners {
 public:
  // Of the pixels' squares of `camera`, widened by `margin` pixels.
  SquareCorners(const CameraModel& camera, double margin);

  // Sets the pixels of whose widened squares all is within a convex outline at z = 1 (ConvexHull),
  // which has three corners or more. `words`: of a mask of the camera's size.
  void AddInside(std::span<const Eigen::Vector2d> outline, std::span<uint64_t> words) const;

 private:
  // At z = 1, by pixel, row by row; NaN where no ray is seen.
  std::vector<std::array<Eigen::Vector2d, 4>> corners_;
  double bend_ = 0;  // how far a square's side bends there at most
};

}  // namespace silhouette
