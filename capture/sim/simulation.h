// SPDX-License-Identifier: Apache-2.0
// The settings of the simulated cell, its cameras, light and room: simulation.yaml.
//
// The world is the robot's base frame: metres, z up. Grey levels are 0..255.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "calib/camera/camera_model.h"
#include "capture/sim/placed_shape.h"
#include "capture/sim/simulated_board.h"

namespace silhouette {

inline constexpr size_t kMaxSimulatedCameras = 8;

struct SimulatedCamera {
  std::string name;
  CameraModel model;
  bool colour = false;  // whether its images are blue, green, red, not grey
};

struct Light {
  // Where the light goes, unit length; it comes from above. Its rays are parallel.
  Eigen::Vector3d direction = -Eigen::Vector3d::UnitZ();
  double ambient = 0.6;  // share of the light that comes from everywhere
  double shadow = 0.5;   // share of the directed light that a shadow takes away
};

// The room around the robot: a box seen from inside.
struct Room {
  Eigen::Vector3d lower{-4, -4, 0};
  Eigen::Vector3d upper{4, 4, 5};
  double brightness = 0.28;  // share of the light that floor and walls throw back
  double texture = 0.05;     // how much that varies from place to place
  // Red, green and blue, each as a multiple of the brightness.
  Eigen::Vector3d tint = Eigen::Vector3d::Ones();
};

struct SimulationSettings {
  std::vector<SimulatedCamera> cameras;
  Light light;
  Room room;
  std::vector<SimulatedBoard> boards;
  CarriedParts parts;
  double blur = 0;               // standard deviation of the lens' blur, pixels
  double exposure = 1;           // factor of all grey levels; what is above 255 is saturated
  double noise_sigma = 1.5;      // grey levels, of every pixel on its own
  double drift_amplitude = 0.0;  // share of the brightness
  double drift_period = 600;     // seconds of simulated time
  double drift_slope = 0.0;      // the same at the image's right edge, less at the left one
  double flicker_amplitude = 0;  // largest random change of an image's brightness, share
  double flicker_slope = 0;      // the same at the right edge, against the left one
  double unsteady_share = 0;     // share of the pixels that jump from image to image
  double unsteady_jump = 40;     // grey levels, at the most
  uint64_t seed = 1;             // noise and texture
  double frame_interval = 0.04;  // simulated seconds from one set of images to the next
  double joint_speed = 0;        // radians or metres a second in real time; 0: the robot jumps
};

// Reads a file; the commented sample is capture/sim/cells/demo/simulation.yaml. InvalidArgument
// with file and line if something is wrong in it.
absl::StatusOr<SimulationSettings> LoadSimulation(const std::string& path);

// `camera_from_world` of a camera at `position` that looks at `look_at`. `up` points upward in the
// image. The three must not lie on a line.
Eigen::Isometry3d LookAt(const Eigen::Vector3d& position, const Eigen::Vector3d& look_at,
                         const Eigen::Vector3d& up);

}  // namespace silhouette
