// SPDX-License-Identifier: Apache-2.0
// A robot that no view sees: a ball behind two joints.
#pragma once

#include <utility>

#include "calib/robot/drawing/drawn_robot.h"

namespace silhouette {

inline DrawnRobot BallRobot(ChainJoint first, ChainJoint second) {
  return DrawnRobot(
      KinematicChain({std::move(first), std::move(second)},
                     {ChainLink{}, {.parent = 0, .joint = 0}, {.parent = 1, .joint = 1}}),
      {{.link = 2,
        .moves_with = 2,
        .points = Eigen::Vector3d(0.3, 0, 0),
        .radius = 0.1,
        .inner = {}}},
      {});
}

}  // namespace silhouette
