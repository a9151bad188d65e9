// SPDX-License-Identifier: Apache-2.0
// Random scenes: what stands in the cell, and where the robot is. The same seed gives the same
// scenes.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "capture/sim/obstacles.h"
#include "db/mask/configuration_grid.h"
#include "tools/silhouette-experiments/cell/simulated_workplace.h"

namespace silhouette::cell_experiment {

// Chance that is the same with every library.
class Chance {
 public:
  // `stream`: of one seed, unrelated chance by number.
  Chance(uint64_t seed, uint64_t stream);

  // Evenly spread over lower..upper.
  double Between(double lower, double upper);
  // 0..count - 1.
  int Below(int count);
  Eigen::Quaterniond Rotation();

 private:
  std::mt19937_64 random_;
};

struct RandomScene {
  std::vector<Obstacle> obstacles;  // 1 to 5, of the sizes of people and of hands
  Configuration robot;              // touches nothing
  bool robot_on_grid = false;
  double time = 0;  // of the simulation, for the drift of the light
};

// What the robot sweeps: the box, in the world, of its body over configurations of the grid.
Eigen::AlignedBox3d SweptBox(const SimulatedWorkplace& workplace);

// A person's trunk, standing on the floor, or an obstacle of the size of a hand or an arm, anywhere
// in `box`.
Obstacle RandomPerson(Chance& chance, const Eigen::AlignedBox3d& box, double floor);
Obstacle RandomHand(Chance& chance, const Eigen::AlignedBox3d& box);

// A configuration anywhere within the grid's limits, or on a grid point.
Configuration RandomConfiguration(Chance& chance, const ConfigurationGrid& grid, bool on_grid);

// Scene `number` of `seed`; the robot stands on a grid point in every other scene.
RandomScene MakeRandomScene(const SimulatedWorkplace& workplace, const Eigen::AlignedBox3d& box,
                            uint64_t seed, int number);

// A scene with one obstacle, a ball, where the robot hides it from all views. `radius`: of the ball
// at least, metres; it is up to a quarter larger. The robot stands on a grid point, touches
// nothing, and is on the line of sight to every point of the ball in every view; some
// configurations of the grid touch it. Nothing if no such place was found, in a search that takes
// seconds.
std::optional<RandomScene> MakeHiddenScene(const SimulatedWorkplace& workplace, double radius,
                                           uint64_t seed, int number);

// A small thing close to the robot.
struct NearThing {
  // Metres: of a ball, or of a forearm, which is a capsule.
  double least_radius = 0;
  double largest_radius = 0;
  // Metres between its surface and the robot's.
  double least_distance = 0;
  double largest_distance = 0;
};

// "near-radius-3-4.5-cm-distance-1-4-cm".
std::string NameOf(const NearThing& thing);

// A hand's sizes and distances, from the smallest and nearest on.
std::vector<NearThing> NearThings();

// A scene with a ball or a forearm as `thing` says, as bright or dark as chance has it. The robot
// stands on a grid point and touches nothing; some configurations of the grid touch the thing.
// Nothing if no such place was found, in a search that takes seconds.
std::optional<RandomScene> MakeNearScene(const SimulatedWorkplace& workplace,
                                         const NearThing& thing, uint64_t seed, int number);

}  // namespace silhouette::cell_experiment
