// SPDX-License-Identifier: Apache-2.0
// What the sound presets know of a cell (docs/verdict-quality.md).
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>

#include "calib/robot/robot_model.h"

namespace silhouette {

struct SoundSettings {
  // Every obstacle is a union of balls of this radius, metres.
  double least_obstacle = 0;
  // Edge of the voxels, metres; nothing: a third of least_obstacle.
  std::optional<double> voxel_edge;
  // Which of the model's geometries is the robot's body. That for collision must be no larger than
  // the robot, but for model_tolerance: no obstacle is looked for inside.
  BodyGeometry geometry = BodyGeometry::kVisual;
  // By how much a point of the true robot's surface may be away from the model's, metres.
  double model_tolerance = 0.01;
  // Whether the model holds all there is of the robot, cables and tool included, but for the
  // payload. Then what the model cannot touch at a configuration does not make it occupied.
  bool whole_model = false;
};

struct SoundCell {
  SoundSettings settings;
  // A box that the robot never leaves, in its base frame, metres.
  Eigen::AlignedBox3d workspace;
  // How far tool and payload reach beyond the model's last link, metres.
  double payload_radius = 0;
  std::shared_ptr<const RobotModel> robot;
};

}  // namespace silhouette
