// SPDX-License-Identifier: Apache-2.0
// A small simulated cell for tests: the robot of tests/calib/robot/urdf_files.h, two cameras.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "calib/robot/robot_model.h"
#include "capture/sim/obstacles.h"
#include "capture/sim/simulated_cell.h"
#include "capture/sim/simulation.h"
#include "tests/calib/robot/urdf_files.h"

namespace silhouette {

inline RobotModel ThreeJointRobot() {
  return RobotModel::FromUrdf(WriteFile(FreshFolder() / "three.urdf", ThreeJointUrdf())).value();
}

inline SimulatedCamera Camera(const std::string& name, const Eigen::Vector3d& position,
                              const Eigen::Vector3d& up) {
  const CameraIntrinsics intrinsics{
      .width = 160, .height = 120, .fx = 110, .fy = 110, .cx = 79.5, .cy = 59.5};
  return {name, CameraModel(intrinsics, LookAt(position, {0, 0, 1}, up))};
}

// No noise and no drift, unless a test says so.
inline SimulationSettings SmallSimulation() {
  SimulationSettings settings;
  settings.cameras = {Camera("top", {0, 0, 4}, Eigen::Vector3d::UnitY()),
                      Camera("front", {3, 0, 1}, Eigen::Vector3d::UnitZ())};
  settings.noise_sigma = 0;
  settings.light.direction = Eigen::Vector3d(0.2, 0, -1).normalized();
  return settings;
}

inline Obstacle BoxAt(const std::string& name, const Eigen::Vector3d& size,
                      const Eigen::Vector3d& position) {
  Obstacle obstacle;
  obstacle.name = name;
  obstacle.mesh = BoxMesh(size);
  obstacle.world_from_obstacle.translation() = position;
  return obstacle;
}

inline int PixelAt(const CameraImage& image, const Eigen::Vector2d& pixel) {
  const auto x = static_cast<size_t>(std::lround(pixel.x()));
  const auto y = static_cast<size_t>(std::lround(pixel.y()));
  return image.pixels.at(y * static_cast<size_t>(image.width) + x);
}

}  // namespace silhouette
