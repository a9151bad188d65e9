// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/scenes.h"

#include <cmath>
#include <numbers>
#include <random>

namespace silhouette::benchmarks {
namespace {

using Eigen::Vector3d;
using Random = std::mt19937_64;

double Between(Random& random, double low, double high) {
  return std::uniform_real_distribution(low, high)(random);
}

Vector3d AroundAxis(Random& random, double nearest, double farthest) {
  const double angle = Between(random, -std::numbers::pi, std::numbers::pi);
  const double distance = Between(random, nearest, farthest);
  return {distance * std::cos(angle), distance * std::sin(angle), 0};
}

// A unit vector in any direction.
Vector3d Direction(Random& random) {
  const double z = Between(random, -1, 1);
  const double angle = Between(random, -std::numbers::pi, std::numbers::pi);
  const double side = std::sqrt(1 - z * z);
  return {side * std::cos(angle), side * std::sin(angle), z};
}

std::vector<Capsule> Person(Random& random) {
  const Vector3d feet = AroundAxis(random, 0.8, 1.5);
  const Vector3d ahead = -feet.normalized();
  const Vector3d aside(-ahead.y(), ahead.x(), 0);
  const auto at = [&](double sideways, double height) -> Vector3d {
    return feet + sideways * aside + height * Vector3d::UnitZ();
  };
  std::vector<Capsule> person = {{at(0, 1.0), at(0, 1.32), 0.17}, {at(0, 1.63), at(0, 1.63), 0.12}};
  for (const double side : {-1.0, 1.0}) {
    person.push_back({at(side * 0.11, 0.08), at(side * 0.11, 0.85), 0.08});
    const Vector3d shoulder = at(side * 0.23, 1.4);
    const Vector3d elbow = shoulder + Between(random, 0.05, 0.25) * ahead + Vector3d(0, 0, -0.22);
    const Vector3d hand = elbow + Between(random, 0.15, 0.35) * ahead +
                          Between(random, -0.1, 0.15) * Vector3d::UnitZ();
    person.push_back({shoulder, elbow, 0.055});
    person.push_back({elbow, hand, 0.045});
  }
  return person;
}

std::vector<Capsule> Hand(Random& random) {
  const Vector3d fist =
      AroundAxis(random, 0.4, 1.1) + Between(random, 0.3, 1.5) * Vector3d::UnitZ();
  const Vector3d away(fist.x(), fist.y(), 0);
  return {{fist, fist, 0.05}, {fist, fist + 0.25 * away.normalized(), 0.04}};
}

std::vector<Capsule> Clutter(Random& random) {
  std::vector<Capsule> things;
  for (int i = 0; i < 24; ++i) {
    const Vector3d from =
        AroundAxis(random, 0.5, 1.6) + Between(random, 0.05, 1.7) * Vector3d::UnitZ();
    const double length = i % 2 == 0 ? 0 : Between(random, 0.1, 0.6);
    things.push_back({from, from + length * Direction(random), Between(random, 0.04, 0.12)});
  }
  return things;
}

std::vector<Capsule> ScenesObstacles(SceneKind kind, Random& random) {
  switch (kind) {
    case SceneKind::kPerson:
      return Person(random);
    case SceneKind::kHand:
      return Hand(random);
    case SceneKind::kClutter:
      return Clutter(random);
  }
  return {};
}

}  // namespace

std::string NameOf(SceneKind kind) {
  switch (kind) {
    case SceneKind::kPerson:
      return "person";
    case SceneKind::kHand:
      return "hand";
    case SceneKind::kClutter:
      return "clutter";
  }
  return "";
}

BenchmarkScene MakeScene(const SyntheticCell& cell, SceneKind kind, uint64_t seed) {
  Random random(seed);
  BenchmarkScene scene;
  scene.obstacles = ScenesObstacles(kind, random);
  for (const GridJoint& joint : cell.grid().joints()) {
    scene.robot.push_back(Between(random, joint.lower, joint.upper));
  }
  scene.images = cell.See(scene.obstacles, scene.robot);
  return scene;
}

std::vector<BenchmarkScene> MakeScenes(const SyntheticCell& cell, SceneKind kind, int count) {
  std::vector<BenchmarkScene> scenes;
  for (int i = 1; i <= count; ++i) {
    scenes.push_back(MakeScene(cell, kind, static_cast<uint64_t>(i)));
  }
  return scenes;
}

}  // namespace silhouette::benchmarks
