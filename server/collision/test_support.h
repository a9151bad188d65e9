// SPDX-License-Identifier: Apache-2.0
// What collision checks rest on beside obstacle images and robot images.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <span>

#include "calib/robot/drawing/drawn_checker.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/collision_images.h"
#include "server/collision/epipolar_bands.h"
#include "server/collision/possible_space.h"

namespace silhouette {

// What a test rests on beside the obstacle images, as far as its policy needs it.
struct TestSupport {
  // Calibrated presets: the lines between the views.
  const EpipolarBands* bands = nullptr;
  // Preset::kPaperCalibrated: ResolvedObstacleImages of the scene, if they are there already.
  const CollisionImages* resolved = nullptr;
  // Sound presets: where the scene's obstacles could be.
  const PossibleSpace* possible_space = nullptr;
  // Drawn robots, presets that only count views: the scene's obstacle planes, if they are prepared.
  const DrawnChecker* drawn = nullptr;
  // Drawn robots with nodes, presets that only count views: whether a node is free in the same
  // scene's map under the same policy, and that is there already; null: there is no map.
  std::function<bool(ConfigurationNumber)> node_is_free = nullptr;
  // Sound presets, if the model of the robot holds all there is of it, tool and payload: whether it
  // may touch a box anywhere between two configurations, along each joint. Links that are exactly
  // where they are at present, at all of them, may be left out: what they touched then, they would
  // touch now.
  using RobotMayTouch = std::function<bool(std::span<const double>, std::span<const double>,
                                           const Eigen::AlignedBox3d&)>;
  RobotMayTouch robot_may_touch = nullptr;
  // Preset::kSound, under the same condition: whether the robot, which touches nothing where it
  // stands, may meet a ball of the least obstacle that is possible on its straight way from there
  // to any configuration between two, along each joint. True if that is not known, as far away.
  using RobotMayMeet = std::function<bool(std::span<const double>, std::span<const double>)>;
  RobotMayMeet robot_may_meet = nullptr;
  // Sound presets, drawn robots: the box beyond which obstacles are not found; nothing: the robot
  // never leaves it.
  std::optional<Eigen::AlignedBox3d> workspace = std::nullopt;
};

}  // namespace silhouette
