// SPDX-License-Identifier: Apache-2.0
// What a camera sees of the empty room: computed once, so that a frame has to trace only the
// pixels that robot, obstacles and their shadows may touch.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "capture/sim/simulation.h"

namespace silhouette {

// One entry per pixel, row by row.
struct Background {
  std::vector<Eigen::Vector3f> ray;      // unit, in the world
  std::vector<float> distance;           // metres to floor, wall or ceiling
  std::vector<float> lit;                // grey level without a shadow
  std::vector<float> shadowed;           // grey level in a shadow; as `lit` where none can fall
  std::vector<uint8_t> receives_shadow;  // whether the floor is seen: walls show no shadows
};

Background MakeBackground(const CameraModel& camera, const SimulationSettings& settings);

// The share of the light that a surface throws to the camera, before its own brightness.
// `cosine`: between its normal and the direction to the light.
double Illumination(const Light& light, double cosine, bool in_shadow);

}  // namespace silhouette
