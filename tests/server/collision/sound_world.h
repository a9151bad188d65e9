// SPDX-License-Identifier: Apache-2.0
// Cameras, obstacles and the body of the sound presets' tests in a world of spheres.
#pragma once

#include <random>
#include <span>
#include <vector>

#include "tests/server/collision/sphere_world.h"

namespace silhouette::testing::sound {

inline constexpr double kSoundRho = 0.06;
inline constexpr double kVoxel = 0.02;

inline std::vector<BallCamera> ThreeCameras() {
  return {BallCamera(LookingAt({2.4, 0.4, 1.1}, {0, 0, 0}, {44, 44}, 0.75, -0.15)),
          BallCamera(LookingAt({-1.0, 2.3, 0.6}, {0, 0, 0}, {40, 48}, 0.75, 0.1)),
          BallCamera(LookingAt({-0.3, -0.2, 2.6}, {0, 0, 0}, {44, 44}, 0.75))};
}

inline std::vector<BallCamera> ThreeParallelCameras() {
  return {BallCamera(Vector3d(0, 0, -1), 40), BallCamera(Vector3d(1, 0, 0), 40),
          BallCamera(Vector3d(-1, 1, -1), 40)};
}

// The second sees only a part of what the robot reaches.
inline std::vector<BallCamera> CamerasThatDoNotSeeAll() {
  return {BallCamera(LookingAt({2.4, 0.4, 1.1}, {0, 0, 0}, {44, 44}, 0.75)),
          BallCamera(LookingAt({-1.0, 2.3, 0.6}, {0.3, 0.2, 0}, {40, 40}, 0.3)),
          BallCamera(LookingAt({-0.3, -0.2, 2.6}, {0, 0, 0}, {44, 44}, 0.75))};
}

// Made once: nearly all the time of a test goes into its world.
inline const SphereWorld& PerspectiveWorld() {
  static const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
  return world;
}
inline const SphereWorld& ParallelWorld() {
  static const SphereWorld world(ThreeParallelCameras(), kSoundRho, kVoxel);
  return world;
}

inline ConfigurationNumber RandomConfiguration(std::mt19937_64& random) {
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  return all[std::uniform_int_distribution<size_t>(0, all.size() - 1)(random)];
}

// One to four obstacles of at least the least size, none of which touches the robot.
inline Balls RandomObstacles(const Balls& robot, std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-0.75, 0.75);
  std::uniform_real_distribution<double> radius(kSoundRho, 0.15);
  Balls obstacles;
  const int count = std::uniform_int_distribution<int>(1, 4)(random);
  while (static_cast<int>(obstacles.size()) < count) {
    const testing::Ball ball{{place(random), place(random), 0.6 * place(random)}, radius(random)};
    if (!Touch(robot, Balls{ball})) obstacles.push_back(ball);
  }
  return obstacles;
}

// The middle between two configurations, and how far every joint may be from it.
struct Range {
  Range(std::span<const double> from, std::span<const double> to) {
    for (size_t j = 0; j < from.size(); ++j) {
      half.push_back((to[j] - from[j]) / 2);
      middle.push_back(from[j] + half[j]);
    }
  }
  Configuration middle;
  Configuration half;
};

// With the true body: balls that are where they are at present touch nothing, as now. In a grid
// cell, those of its middle, grown by how far they move.
inline TestSupport WithBody(const PossibleSpace& possible, ConfigurationNumber present) {
  const auto may_touch = [present](std::span<const double> from, std::span<const double> to,
                                   const Eigen::AlignedBox3d& box) {
    const Range cell(from, to);
    const Balls now = SphereWorld::Arm(present);
    const Balls then = testing::ArmAt(cell.middle[0], cell.middle[1]);
    const Vector3d elbow = then[4].centre;
    for (size_t i = 0; i < then.size(); ++i) {
      const double by_pitch = i > 4 ? cell.half[1] * (then[i].centre - elbow).norm() : 0;
      const double growth = by_pitch + cell.half[0] * (then[i].centre.norm() + by_pitch);
      if (growth == 0 && (then[i].centre - now[i].centre).norm() < 1e-9) continue;
      if (box.exteriorDistance(then[i].centre) <= then[i].radius + growth) return true;
    }
    return false;
  };
  return {.bands = nullptr,
          .resolved = nullptr,
          .possible_space = &possible,
          .robot_may_touch = may_touch};
}

inline TestSupport Without(const PossibleSpace& possible) {
  return {.bands = nullptr,
          .resolved = nullptr,
          .possible_space = &possible,
          .robot_may_touch = nullptr};
}

}  // namespace silhouette::testing::sound
