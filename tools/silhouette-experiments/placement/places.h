// SPDX-License-Identifier: Apache-2.0
// Where cameras could be mounted, and what they are tried on: places.yaml. The commented sample is
// tools/silhouette-experiments/placement/places.yaml.
//
// The world is the robot's base frame: metres, z up. Angles in radians.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/camera_model.h"
#include "db/mask/mask.h"

namespace silhouette {

// A camera at a place where it could be mounted. Its image is the view's mask.
struct Candidate {
  std::string name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d look_at = Eigen::Vector3d::Zero();
  CameraModel camera;
};

struct PlacementSamples {
  int configurations = 200;  // of the grid: test and current configurations
  int scenes = 60;
  int least_obstacles = 1;  // per scene
  int most_obstacles = 5;
  double least_radius = 0.06;  // of an obstacle's balls, capsules and boxes
  double greatest_radius = 0.25;
  uint64_t seed = 1;
};

struct Places {
  MaskSize mask_size;
  double field_of_view = 0;  // that the image's width spans
  int cameras = 0;           // to be chosen
  std::vector<Candidate> candidates;
  PlacementSamples samples;
};

// Reads a file. InvalidArgument with file and line if something is wrong in it.
absl::StatusOr<Places> LoadPlaces(const std::string& path);

}  // namespace silhouette
