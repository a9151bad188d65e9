// SPDX-License-Identifier: Apache-2.0
// Calibration: how the views of a cell see space, and each other. A plain value.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/camera/camera_model.h"

namespace silhouette {

// What is known of a pair of views without camera models: x_b' F x_a = 0 for the images x_a, x_b of
// one point, homogeneous mask-pixel coordinates, integers at pixel centres. Affine matrices
// (parallel projection) are fundamental matrices like any other.
struct FundamentalMatrix {
  int view_a = 0;
  int view_b = 0;
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();
};

// Either camera models or fundamental matrices.
struct Calibration {
  // One per view, for images of the camera's size; empty where only `fundamental_matrices` are
  // known. The world is the robot's base frame.
  std::vector<CameraModel> cameras;
  // Each pair of views at most once, in either order; a pair that is missing has no lines.
  std::vector<FundamentalMatrix> fundamental_matrices;
};

}  // namespace silhouette
