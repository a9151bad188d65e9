// SPDX-License-Identifier: Apache-2.0
// People who walk about in a cell by a script, and what they are made of. Pure: no robot, no scene.
//
// The world is the robot's base frame: metres, z up; times in seconds.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "capture/sim/body_part.h"
#include "capture/sim/chance.h"
#include "capture/sim/obstacles.h"

namespace silhouette::people_experiment {

// A box of half extents `half` about the frame's origin, grown by `radius`: a capsule, a box.
struct Shape {
  Eigen::Vector3d half = Eigen::Vector3d::Zero();
  double radius = 0;
};

// A shape somewhere in the world.
struct PlacedShape {
  Shape shape;
  Eigen::Isometry3d world_from_shape = Eigen::Isometry3d::Identity();
};

// Trunk, arm and the box that some carry.
enum PersonPart : size_t { kTrunk = 0, kArm, kBox };
Shape ShapeOf(PersonPart part);

// As obstacles of the simulated cell, each PersonPart of each of `count` people.
std::vector<Obstacle> PeopleObstacles(int count);

// What a person does at a moment of the script. In between all of it changes evenly.
struct PersonKey {
  double time = 0;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  // Where the person looks, and the arm points, from x; and how far it is lifted: 0 it hangs, 1 it
  // is level.
  double direction = 0;
  double reach = 0;
  bool carries = false;  // until the next key
};

class Person {
 public:
  // `keys`: at least one, times ascend. `floor`: z that the person stands on.
  Person(std::vector<PersonKey> keys, double floor);

  PersonKey At(double time) const;
  // By PersonPart, without the box if none is carried.
  std::vector<PlacedShape> PartsAt(double time) const;
  // Poses in the order of PeopleObstacles; a box that nobody carries lies far away.
  void AppendPoses(double time, Poses& poses) const;

 private:
  Eigen::Isometry3d PoseOf(PersonPart part, const PersonKey& key) const;

  std::vector<PersonKey> keys_;
  double floor_;
};

struct ScriptSettings {
  double seconds = 60;
  double fence = 2;  // radius about the base, metres
  double floor = 0;
};

// One to three people who come into the fence, stand, reach towards the robot, carry boxes and
// leave. How busy it is differs from script to script; in the mean somebody is inside the fence
// about half of the time. The same chance gives the same script.
std::vector<Person> RandomPeople(Chance& chance, const ScriptSettings& settings);

// Whether a part of any of them is inside the fence at the time.
bool AnyInside(std::span<const Person> people, std::span<const double> times, double fence);

}  // namespace silhouette::people_experiment
