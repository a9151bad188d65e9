// SPDX-License-Identifier: Apache-2.0
// Which balls lie in an obstacle: what the sound presets promise is about unions of such balls.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/sim/obstacles.h"

namespace silhouette::cell_experiment {

// Centres of balls of `radius`, metres, that hold `point` and lie in the obstacle where it stands
// at time 0, up to half a millimetre: the one nearest to the point and some others. None if the
// obstacle is too thin there, as near an edge of a box. In the world. A convex obstacle; of any
// other only balls on the inner side of all its faces.
std::vector<Eigen::Vector3d> BallsWithin(const Obstacle& obstacle, const Eigen::Vector3d& point,
                                         double radius);

// Points of a ball: all over its surface, and its centre.
std::vector<Eigen::Vector3d> PointsOfBall(const Eigen::Vector3d& centre, double radius);

}  // namespace silhouette::cell_experiment
