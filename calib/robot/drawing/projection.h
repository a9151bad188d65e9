// SPDX-License-Identifier: Apache-2.0
// Where a camera sees many points. Uses the standard library and Eigen alone. Results replace what
// their vector held; nothing allocates once it has the room.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "calib/camera/camera_model.h"

namespace silhouette {

// What points have at least and at most: x, y, x + y, x - y.
struct Octagon {
  std::array<double, 4> low{};
  std::array<double, 4> high{};
};

// Where points are in the camera's frame, and at z = 1.
struct ProjectedExtent {
  double sum = 0;  // of all numbers' sizes: finite if all are, or too large for a body
  double nearest = 0;
  double farthest = 0;
  double off_axis = 0;  // at z = 1, squared
  Octagon octagon;      // at z = 1
};

// `points`: at least one, as columns. `projected`: of each, at z = 1.
ProjectedExtent Project(const Eigen::Isometry3d& camera_from_points,
                        const Eigen::Ref<const Eigen::Matrix3Xd>& points,
                        std::vector<Eigen::Vector2d>& projected);

// PixelAt of each point at z = 1, at least one; where they are.
Octagon PixelsAt(const CameraIntrinsics& intrinsics, const std::vector<Eigen::Vector2d>& projected,
                 std::vector<Eigen::Vector2d>& pixels);

}  // namespace silhouette
