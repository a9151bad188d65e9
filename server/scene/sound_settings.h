// SPDX-License-Identifier: Apache-2.0
// What the sound presets, and speed and separation, know of a cell (docs/verdict-quality.md).
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "calib/robot/robot_model.h"
#include "server/collision/separation.h"

namespace silhouette {

struct SoundSettings {
  // Every obstacle is a union of balls of this radius, metres.
  double least_obstacle = 0;
  // Edge of the voxels, metres; nothing: SoundCell::VoxelEdge() chooses.
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

// Speed and separation, in the same cell. Lengths in metres.
struct SeparationCell {
  SeparationSettings settings;
  // Where people may be, in the robot's base frame; the workspace besides. Nothing: as far about
  // the workspace as distances count.
  std::optional<Eigen::AlignedBox3d> zone{};
  // Of its voxels; nothing: as fine as SeparationBasis::kVoxelsByDefault permit, a sixth to a
  // third of the least obstacle.
  std::optional<double> voxel_edge;
  // Whether voxels that no view sees whole are empty.
  bool unseen_is_empty = false;
};

struct SoundCell {
  SoundSettings settings;
  // Where obstacles are looked for, a box in the robot's base frame, metres. The robot never leaves
  // it ...
  Eigen::AlignedBox3d workspace;
  // ... unless this is set, of a robot whose images are drawn: then nothing is free where it does.
  bool robot_may_leave = false;
  // How far tool and payload reach beyond the model's last link, metres.
  double payload_radius = 0;
  std::shared_ptr<const RobotModel> robot;
  std::optional<SeparationCell> separation = std::nullopt;  // nothing: distances are not served

  // The finer the voxels, the less they block beside the robot. So they are an eighth of the least
  // obstacle; coarser where there would be more than kVoxelsByDefault, but at most a third.
  static constexpr double kVoxelsByDefault = 1.6e7;
  double VoxelEdge() const {
    const double rho = settings.least_obstacle;
    const double coarser = std::cbrt(workspace.volume() / kVoxelsByDefault);
    return settings.voxel_edge.value_or(std::max(rho / 8, std::min(coarser, rho / 3)));
  }
};

}  // namespace silhouette
