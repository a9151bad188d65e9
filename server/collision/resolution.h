// SPDX-License-Identifier: Apache-2.0
// What the sound presets can tell from the robot: a rule of thumb for choosing mask sizes and the
// least obstacle. Part of the pure core.
//
// Between the robot and the hull of its any-touch silhouettes lies a shell about one and a half
// mask pixels thick, and the tolerances of projection and model. It holds no obstacle, and so
// blocks nothing, where it is thinner than what is certain of an obstacle's ball.
#pragma once

#include <Eigen/Geometry>
#include <span>

#include "calib/camera/camera_model.h"

namespace silhouette {

struct ResolutionInput {
  // Of the views, for images of the size of their masks.
  std::span<const CameraModel> cameras = {};
  // Pixels of the masks by which projection and differencing may err.
  double margin = 0;
  Eigen::AlignedBox3d workspace = {};
  double model_tolerance = 0;  // metres
};

// The radius of the least obstacle, in metres, that the cell can tell from the robot around the
// middle of the workspace. 0 if no camera sees it.
double ResolvableObstacle(const ResolutionInput& input);

// By how much the masks must have more pixels along each side for `least_obstacle`; at most 1: they
// have enough. Infinity if no mask would do, for the model's tolerance alone is too large.
double MaskScaleFor(const ResolutionInput& input, double least_obstacle);

}  // namespace silhouette
