// SPDX-License-Identifier: Apache-2.0
// The sound presets on all configurations of a simulated cell, with all sets of cameras.
//
// The robot's model is known. At its present configuration it separates the robot's own body from
// what may be an obstacle. At the test configuration it decides what planes cannot, and refines;
// spheres that are where they are at present are left out. The verdicts are those of
// server/collision/collision_checker.h, configuration by configuration; cameras out of the set are
// missing views.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/collision/possible_space.h"
#include "tools/silhouette-experiments/paper/bulk_checker.h"
#include "tools/silhouette-experiments/paper/settings.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"

namespace silhouette::paper {

// The voxels of a cell, and those that each sphere of the robot touches at each configuration.
// Cannot be changed once made; used by any number of threads.
class SoundSpace {
 public:
  // `cell` must outlive it.
  SoundSpace(const SphereCell& cell, const SoundSettings& settings);

  const SphereCell& cell() const { return cell_; }
  const VoxelSpace& space() const { return space_; }

  struct Row {
    uint16_t y = 0;
    uint16_t z = 0;
    uint16_t first = 0;
    uint16_t last = 0;
  };
  // The voxels that sphere `sphere` of the arm touches at configuration `index`.
  std::span<const Row> Touched(size_t index, size_t sphere) const;

 private:
  const SphereCell& cell_;
  VoxelSpace space_;
  size_t per_link_;
  std::vector<size_t> starts_;
  std::vector<Row> rows_;
};

// The occupied configurations.
struct SoundVerdicts {
  ConfigurationSet planes;  // sound-planes
  ConfigurationSet voxels;  // sound
};

// The body of a robot of spheres, which must outlive it.
BodyDistance BodyOf(std::span<const Sphere> robot);

// Checks all configurations of the grid in a scene with the views of `views`. `images`: of all
// views. `body`, `robot`: at its present configuration. Without `robot` it checks configurations in
// the grid cells instead, by the union of the robot images at their corners, without the robot's
// body there.
SoundVerdicts CheckSound(const SoundSpace& sound, std::span<const ObstacleImage> images,
                         ViewSet views, const BodyDistance& body, const Spheres* robot);

}  // namespace silhouette::paper
