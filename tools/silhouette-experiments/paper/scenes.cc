// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/scenes.h"

#include <algorithm>
#include <numbers>
#include <stdexcept>

namespace silhouette::paper {
namespace {

constexpr double kScenesTurn = 2 * std::numbers::pi;
constexpr int kScenesMostTries = 1000;

Spheres RandomObstacles(const Settings& settings, RandomNumbers& random) {
  const RandomScenes& range = settings.random;
  Spheres spheres(static_cast<size_t>(random.WholeBetween(range.spheres[0], range.spheres[1])));
  for (Sphere& sphere : spheres) {
    sphere.radius = random.Between(range.radius[0], range.radius[1]);
    for (int axis = 0; axis < 3; ++axis)
      sphere.centre[axis] = random.Between(-range.box, range.box);
  }
  return spheres;
}

std::vector<std::array<int, 2>> FreeConfigurations(const Settings& settings, Variant variant,
                                                   const Spheres& obstacles) {
  std::vector<std::array<int, 2>> free;
  const double step = kScenesTurn / settings.steps;
  for (int a = 0; a < settings.steps; ++a) {
    for (int b = 0; b < settings.steps; ++b) {
      if (!Touch(ArmAt(settings.arm, variant, a * step, b * step), obstacles)) {
        free.push_back({a, b});
      }
    }
  }
  return free;
}

}  // namespace

double RandomNumbers::Next() {
  // SplitMix64 (Steele, Lea, Flood 2014).
  state_ += 0x9e3779b97f4a7c15;
  uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * 0x1p-53;
}

int RandomNumbers::WholeBetween(int from, int to) {
  return std::min(to, from + static_cast<int>(Next() * (to - from + 1)));
}

SphereScene RandomScene(const Settings& settings, Variant variant, int number) {
  RandomNumbers random(settings.random.seed * 0x100000001b3 + static_cast<uint64_t>(number));
  SphereScene scene;
  std::vector<std::array<int, 2>> free;
  for (int tries = 0; free.empty(); ++tries) {
    if (tries == kScenesMostTries) {
      throw std::invalid_argument("random obstacles leave the robot no free configuration");
    }
    scene.obstacles = RandomObstacles(settings, random);
    free = FreeConfigurations(settings, variant, scene.obstacles);
  }
  scene.current = free[static_cast<size_t>(random.WholeBetween(0, int(free.size()) - 1))];
  // A free configuration of the grid has free ones around it, so that this ends.
  do {
    scene.current_off_grid = {random.Between(0, kScenesTurn), random.Between(0, kScenesTurn)};
  } while (Touch(ArmAt(settings.arm, variant, scene.current_off_grid[0], scene.current_off_grid[1]),
                 scene.obstacles));
  scene.offsets.resize(static_cast<size_t>(settings.steps * settings.steps));
  for (std::array<double, 2>& offset : scene.offsets) offset = {random.Next(), random.Next()};
  return scene;
}

}  // namespace silhouette::paper
