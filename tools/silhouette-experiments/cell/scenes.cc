// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/scenes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/sim/contact.h"
#include "capture/sim/ray_scene.h"

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
  const std::vector<BodyPart> parts = BodyPartsOf(workplace.robot());
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

namespace {

constexpr uint64_t kHiddenStream = uint64_t{1} << 41;  // of chance: apart from other scenes'
constexpr int kRobots = 200;                           // configurations that are tried
constexpr int kPlaces = 2000;                          // places near the robot, for each
constexpr int kNearPlaces = 100;                       // the same for a near thing
constexpr double kFarthest = 0.3;                      // metres from the robot's surface
constexpr double kForearm = 0.25;                      // metres between the ends' centres
constexpr uint64_t kNearStream = uint64_t{1} << 42;
constexpr int kTests = 100;        // configurations, of which some must touch
constexpr double kLargest = 1.25;  // radius of a ball, as multiple of the least

// For a place of one thing beside the robot.
class Search {
 public:
  // `radius`: least height above the floor.
  Search(const SimulatedWorkplace& workplace, Chance& chance, const Obstacle& thing, double radius)
      : workplace_(workplace),
        chance_(chance),
        thing_(thing),
        radius_(radius),
        contact_(workplace.robot(), {&thing, 1}),
        parts_(BodyPartsOf(workplace.robot())),
        rays_(parts_),
        cameras_(workplace.TrueCalibration().cameras) {}

  // The ball's pose, hidden near the robot at `links`.
  std::optional<Eigen::Isometry3d> Hidden(const Poses& links) {
    rays_.Place(links);
    for (int i = 0; i < kPlaces; ++i) {
      const std::optional<Eigen::Isometry3d> pose = Beside(links, 0, kFarthest);
      if (!pose || !Hidden(pose->translation()) || contact_.Touches(links, {*pose})) continue;
      const bool all_hidden =
          std::all_of(thing_.mesh.vertices.begin(), thing_.mesh.vertices.end(),
                      [&](const Eigen::Vector3d& point) { return Hidden(*pose * point); });
      if (all_hidden && InTheWay(*pose)) return pose;
    }
    return std::nullopt;
  }

  // The thing's pose, its surface that far from the robot at `links`.
  std::optional<Eigen::Isometry3d> Near(const Poses& links, double least, double largest) {
    for (int i = 0; i < kNearPlaces; ++i) {
      std::optional<Eigen::Isometry3d> pose = Beside(links, least + radius_, largest + radius_);
      if (!pose) continue;
      pose->linear() = chance_.Rotation().toRotationMatrix();
      const double distance = contact_.Check(links, {*pose}).distance;
      if (distance >= least && distance <= largest && InTheWay(*pose)) return pose;
    }
    return std::nullopt;
  }

 private:
  // Some place, so far from a corner of the robot's meshes; nothing if it is not above the floor.
  std::optional<Eigen::Isometry3d> Beside(const Poses& links, double least, double largest) {
    const BodyPart& part = parts_[static_cast<size_t>(chance_.Below(int(parts_.size())))];
    const Eigen::Vector3d& vertex =
        part.mesh.vertices[static_cast<size_t>(chance_.Below(int(part.mesh.vertices.size())))];
    const Eigen::Vector3d away = chance_.Rotation() * Eigen::Vector3d::UnitZ();
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = links[part.frame] * vertex + chance_.Between(least, largest) * away;
    const double floor = workplace_.simulation().settings().room.lower.z();
    if (pose.translation().z() <= floor + radius_) return std::nullopt;
    return pose;
  }

  bool Hidden(const Eigen::Vector3d& point) const {
    return std::all_of(cameras_.begin(), cameras_.end(), [&](const CameraModel& camera) {
      return rays_.Meets(camera.Centre(), point - camera.Centre());
    });
  }

  // Whether the robot touches the thing in some configurations.
  bool InTheWay(const Eigen::Isometry3d& pose) const {
    for (int i = 0; i < kTests; ++i) {
      const Configuration q = RandomConfiguration(chance_, workplace_.cell().grid, true);
      if (contact_.Touches(workplace_.LinkPoses(q), {pose})) return true;
    }
    return false;
  }

  const SimulatedWorkplace& workplace_;
  Chance& chance_;
  const Obstacle& thing_;
  const double radius_;
  const ContactChecker contact_;
  const std::vector<BodyPart> parts_;
  BodyRays rays_;
  const std::vector<CameraModel> cameras_;
};

}  // namespace

std::optional<RandomScene> MakeHiddenScene(const SimulatedWorkplace& workplace, double radius,
                                           uint64_t seed, int number) {
  Chance chance(seed, kHiddenStream + static_cast<uint64_t>(number));
  Obstacle ball;
  ball.name = "hidden hand";
  const double of_ball = radius * chance.Between(1, kLargest);
  ball.mesh = SphereMesh(of_ball);
  ball.brightness = chance.Between(0.02, 0.95);
  Search search(workplace, chance, ball, of_ball);
  for (int i = 0; i < kRobots; ++i) {
    RandomScene scene;
    scene.robot_on_grid = true;
    scene.robot = RandomConfiguration(chance, workplace.cell().grid, true);
    const auto pose = search.Hidden(workplace.LinkPoses(scene.robot));
    if (!pose) continue;
    ball.world_from_obstacle = *pose;
    scene.obstacles = {ball};
    return scene;
  }
  return std::nullopt;
}

std::string NameOf(const NearThing& thing) {
  return absl::StrFormat("near-radius-%g-%g-cm-distance-%g-%g-cm", 100 * thing.least_radius,
                         100 * thing.largest_radius, 100 * thing.least_distance,
                         100 * thing.largest_distance);
}

std::vector<NearThing> NearThings() {
  std::vector<NearThing> things;
  for (const auto& [least_radius, largest_radius] : {std::pair(0.03, 0.045), {0.045, 0.06}}) {
    for (const auto& [least, largest] : {std::pair(0.01, 0.04), {0.04, 0.08}, {0.08, 0.12}}) {
      things.push_back({least_radius, largest_radius, least, largest});
    }
  }
  return things;
}

std::optional<RandomScene> MakeNearScene(const SimulatedWorkplace& workplace,
                                         const NearThing& thing, uint64_t seed, int number) {
  Chance chance(seed, kNearStream + static_cast<uint64_t>(number));
  const double radius = chance.Between(thing.least_radius, thing.largest_radius);
  Obstacle near;
  const bool forearm = chance.Below(2) == 0;
  near.name = forearm ? "forearm" : "ball";
  near.mesh = forearm ? CapsuleMesh(radius, kForearm) : SphereMesh(radius);
  near.brightness = chance.Between(0.02, 0.95);
  Search search(workplace, chance, near, radius);
  for (int i = 0; i < kRobots; ++i) {
    RandomScene scene;
    scene.robot_on_grid = true;
    scene.robot = RandomConfiguration(chance, workplace.cell().grid, true);
    const auto pose =
        search.Near(workplace.LinkPoses(scene.robot), thing.least_distance, thing.largest_distance);
    if (!pose) continue;
    near.world_from_obstacle = *pose;
    scene.obstacles = {near};
    return scene;
  }
  return std::nullopt;
}

}  // namespace silhouette::cell_experiment
