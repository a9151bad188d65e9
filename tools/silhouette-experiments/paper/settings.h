// SPDX-License-Identifier: Apache-2.0
// What the paper's simulation is made of: geometry, cameras, scenes, seeds. Read from a file; the
// one that is shipped, paper.yaml, is commented.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tools/silhouette-experiments/paper/geometry.h"

namespace silhouette::paper {

// Seeded scenes of spheres.
struct RandomScenes {
  uint64_t seed = 1;
  int count = 200;
  std::array<int, 2> spheres{1, 5};          // least and greatest number in a scene
  std::array<double, 2> radius{0.06, 0.20};  // least and greatest
  double box = 0.6;                          // centres lie in [-box, box]^3, evenly spread
};

struct SoundSettings {
  double least_radius = 0.06;  // rho
  double edge = 0.015625;      // of a voxel
  // Scenes that are evaluated of figure7_occluded, evenly spread, and of the experiments off the
  // grid, the first; 0: all.
  int occluded_scenes = 40;
  int off_grid_scenes = 50;
};

struct ReconstructionSettings {
  std::vector<int> voxels{64, 128};  // along each edge of the cube, one study each
  int scenes = 12;                   // of the random ones, the first
};

// A rectangle with its edges along x and y.
struct Rectangle {
  std::array<double, 2> from{};
  std::array<double, 2> to{};
};

// A pinhole camera in the plane.
struct FlatCamera {
  std::string name;
  std::array<double, 2> at{};
};

// The floor plan of Figure 1.
struct FloorPlan {
  std::array<double, 2> size{};  // of the cell, from 0, 0
  std::vector<Rectangle> obstacles;
  std::vector<FlatCamera> cameras;  // the first two, and the third that is used in addition
};

struct Settings {
  double half_width = 1;
  int pixels = 64;
  ArmShape arm;
  int steps = 72;  // of the grid, per joint
  // By name; one to four cameras each.
  std::map<std::string, std::vector<ParallelCamera>> rigs;
  Spheres figure7;                     // obstacles
  std::array<double, 2> parked{0, 0};  // where the robot occludes none of them
  RandomScenes random;
  SoundSettings sound;
  ReconstructionSettings reconstruction;
  FloorPlan floor_plan;
};

// The text of paper.yaml, the commented default.
const char* DefaultSettingsText();

// From a file; an empty path: the default. Throws YamlError (common/yaml/strict_yaml.h) if the file
// is not there, is not YAML or says what cannot be.
Settings ReadSettings(const std::string& path);

}  // namespace silhouette::paper
