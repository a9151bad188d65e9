// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/random_scene.h"

#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/sim/contact.h"

namespace silhouette::cell_experiment {
namespace {

constexpr int kMostObstacles = 5;
constexpr int kTriesForRobot = 100;  // configurations, before other obstacles are taken
constexpr double kDriftTime = 600;   // seconds over which scenes are spread

// The splitmix64 step: neighbouring inputs give unrelated outputs.
uint64_t Scatter(uint64_t x) {
  x += 0x9E3779B97F4A7C15u;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

Eigen::Vector3d PointIn(Chance& chance, const Eigen::AlignedBox3d& box) {
  return {chance.Between(box.min().x(), box.max().x()),
          chance.Between(box.min().y(), box.max().y()),
          chance.Between(box.min().z(), box.max().z())};
}

std::vector<Obstacle> RandomObstacles(Chance& chance, const Eigen::AlignedBox3d& box,
                                      double floor) {
  std::vector<Obstacle> obstacles;
  const int count = 1 + chance.Below(kMostObstacles);
  for (int i = 0; i < count; ++i) {
    const bool person = chance.Below(2) == 0;
    obstacles.push_back(person ? RandomPerson(chance, box, floor) : RandomHand(chance, box));
    absl::StrAppend(&obstacles.back().name, " ", i + 1);
  }
  return obstacles;
}

}  // namespace

Chance::Chance(uint64_t seed, uint64_t stream) : random_(Scatter(seed ^ Scatter(stream))) {}

double Chance::Between(double lower, double upper) {
  return lower + (upper - lower) * (static_cast<double>(random_() >> 11) * 0x1p-53);
}

int Chance::Below(int count) { return static_cast<int>(random_() % static_cast<uint64_t>(count)); }

// Shoemake 1992.
Eigen::Quaterniond Chance::Rotation() {
  const double u = Between(0, 1);
  const double a = Between(0, 2 * std::numbers::pi);
  const double b = Between(0, 2 * std::numbers::pi);
  return {std::sqrt(1 - u) * std::sin(a), std::sqrt(1 - u) * std::cos(a),
          std::sqrt(u) * std::sin(b), std::sqrt(u) * std::cos(b)};
}

Eigen::AlignedBox3d SweptBox(const SimulatedWorkplace& workplace) {
  constexpr uint64_t kConfigurations = 400;
  const ConfigurationGrid& grid = workplace.cell().grid;
  const std::vector<BodyPart> parts = RobotParts(workplace.robot());
  const uint64_t stride = std::max<uint64_t>(1, grid.number_limit() / kConfigurations);
  Eigen::AlignedBox3d box;
  for (uint64_t number = 0; number < grid.number_limit(); ++number) {
    // The first of every stretch that has one.
    if (!grid.Contains(number)) continue;
    const Poses links = workplace.LinkPoses(grid.At(number));
    for (const BodyPart& part : parts) {
      for (const Eigen::Vector3d& vertex : part.mesh.vertices) {
        box.extend(links[part.frame] * vertex);
      }
    }
    number = number / stride * stride + stride - 1;
  }
  return box;
}

Obstacle RandomPerson(Chance& chance, const Eigen::AlignedBox3d& box, double floor) {
  Obstacle person;
  person.name = "person";
  double height = 0;
  if (chance.Below(2) == 0) {
    const double radius = chance.Between(0.15, 0.25);
    const double length = chance.Between(1.0, 1.4);
    person.mesh = CapsuleMesh(radius, length);
    height = length + 2 * radius;
  } else {
    height = chance.Between(1.4, 1.9);
    person.mesh = BoxMesh({chance.Between(0.3, 0.5), chance.Between(0.2, 0.35), height});
  }
  const Eigen::Vector3d at = PointIn(chance, box);
  person.world_from_obstacle =
      Eigen::Translation3d(at.x(), at.y(), floor + height / 2) *
      Eigen::AngleAxisd(chance.Between(0, 2 * std::numbers::pi), Eigen::Vector3d::UnitZ());
  person.brightness = chance.Between(0.02, 0.95);
  return person;
}

Obstacle RandomHand(Chance& chance, const Eigen::AlignedBox3d& box) {
  Obstacle hand;
  hand.name = "hand";
  switch (chance.Below(4)) {
    case 0:
      hand.mesh = SphereMesh(chance.Between(0.04, 0.12));
      break;
    case 1:
      hand.mesh = CapsuleMesh(chance.Between(0.035, 0.06), chance.Between(0.05, 0.15));
      break;
    case 2:
      hand.name = "arm";
      hand.mesh = CapsuleMesh(chance.Between(0.04, 0.06), chance.Between(0.4, 0.7));
      break;
    default:
      hand.mesh = BoxMesh(
          {chance.Between(0.07, 0.2), chance.Between(0.07, 0.2), chance.Between(0.07, 0.2)});
      break;
  }
  const Eigen::Vector3d at = PointIn(chance, box);
  hand.world_from_obstacle = Eigen::Translation3d(at) * chance.Rotation();
  hand.brightness = chance.Between(0.02, 0.95);
  return hand;
}

Configuration RandomConfiguration(Chance& chance, const ConfigurationGrid& grid, bool on_grid) {
  Configuration q;
  for (const GridJoint& joint : grid.joints()) {
    const double value = chance.Between(joint.lower, joint.upper);
    q.push_back(value);
  }
  if (!on_grid) return q;
  return grid.At(*grid.Nearest(q));
}

RandomScene MakeRandomScene(const SimulatedWorkplace& workplace, const Eigen::AlignedBox3d& box,
                            uint64_t seed, int number) {
  Chance chance(seed, static_cast<uint64_t>(number));
  RandomScene scene;
  scene.robot_on_grid = number % 2 == 0;
  scene.time = chance.Between(0, kDriftTime);
  const double floor = workplace.simulation().settings().room.lower.z();
  while (true) {
    scene.obstacles = RandomObstacles(chance, box, floor);
    const ContactChecker contact(workplace.robot(), scene.obstacles);
    const Poses poses = ObstaclePoses(scene.obstacles, 0);
    for (int i = 0; i < kTriesForRobot; ++i) {
      scene.robot = RandomConfiguration(chance, workplace.cell().grid, scene.robot_on_grid);
      if (!contact.Touches(workplace.LinkPoses(scene.robot), poses)) return scene;
    }
  }
}

}  // namespace silhouette::cell_experiment
