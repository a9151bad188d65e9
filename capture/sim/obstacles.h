// SPDX-License-Identifier: Apache-2.0
// The obstacles of the simulated cell, and obstacles.yaml, the scene file that describes them.
//
// The world is the robot's base frame: metres, z up. Angles in radians. Times in seconds of
// simulated time.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/triangle_mesh.h"

namespace silhouette {

// Where a moving obstacle is at a time; between two waypoints it moves straight and evenly, before
// the first and after the last it stands still.
struct Waypoint {
  double time = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

struct Obstacle {
  std::string name;
  TriangleMesh mesh;  // closed, in the obstacle's own frame
  Eigen::Isometry3d world_from_obstacle = Eigen::Isometry3d::Identity();  // at time 0
  double brightness = 0.1;  // share of the light that it throws back, 0..1
  // Red, green and blue, each as a multiple of the brightness.
  Eigen::Vector3d tint = Eigen::Vector3d::Ones();
  // It moves by `velocity` (metres per second) or, if there are any, along `waypoints`, whose times
  // grow.
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  std::vector<Waypoint> waypoints;

  // `world_from_obstacle` at `time`.
  Eigen::Isometry3d PoseAt(double time) const;
};

// Reads a scene file; the commented sample is capture/sim/cells/demo/obstacles.yaml. Paths of
// meshes are relative to the file. InvalidArgument with file and line if something is wrong in it.
absl::StatusOr<std::vector<Obstacle>> LoadObstacles(const std::string& path);

}  // namespace silhouette
