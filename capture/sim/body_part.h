// SPDX-License-Identifier: Apache-2.0
// The one representation of robot and obstacles that pictures and truth share: rigid parts made of
// triangles.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "calib/robot/robot_model.h"
#include "calib/robot/triangle_mesh.h"
#include "capture/sim/obstacles.h"

namespace silhouette {

// `world_from_frame` of every frame.
using Poses = std::vector<Eigen::Isometry3d>;

struct BodyPart {
  std::string name;         // of the link or obstacle
  size_t frame = 0;         // index of the link or obstacle whose pose the part follows
  TriangleMesh mesh;        // in that frame
  double brightness = 0.7;  // share of the light that it throws back, 0..1
  // Red, green and blue, each as a multiple of the brightness.
  Eigen::Vector3d tint = Eigen::Vector3d::Ones();
};

// One part per piece of the links' geometry; the frames are the model's links.
std::vector<BodyPart> BodyPartsOf(const RobotModel& robot);

// One part per obstacle; the frames are the obstacles.
std::vector<BodyPart> ObstacleParts(std::span<const Obstacle> obstacles);

Poses ObstaclePoses(std::span<const Obstacle> obstacles, double time);

}  // namespace silhouette
