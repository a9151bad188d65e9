// SPDX-License-Identifier: Apache-2.0
// The scenes of the experiments: obstacles, and where the robot is meanwhile.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tools/silhouette-experiments/paper/settings.h"

namespace silhouette::paper {

struct SphereScene {
  Spheres obstacles;
  // A configuration of the grid that touches no obstacle, by its steps along both joints.
  std::array<int, 2> current{};
  // Joint values of another that touches none, off the grid.
  std::array<double, 2> current_off_grid{};
  // Where in the grid cell between step (a, b) and the next ones a test configuration off the grid
  // lies: shares of the step at a * steps + b.
  std::vector<std::array<double, 2>> offsets;
};

// Numbers from 0 to 1 that are the same on every machine.
class RandomNumbers {
 public:
  explicit RandomNumbers(uint64_t seed) : state_(seed) {}
  double Next();
  double Between(double from, double to) { return from + (to - from) * Next(); }
  // `from` to `to`, both included.
  int WholeBetween(int from, int to);

 private:
  uint64_t state_;
};

// Random scene `number`, 0 to settings.random.count - 1. Obstacles are drawn again where they leave
// the robot no free configuration on the grid. Throws std::invalid_argument if they always do.
SphereScene RandomScene(const Settings& settings, Variant variant, int number);

}  // namespace silhouette::paper
