// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/hidden_scene.h"

#include <algorithm>
#include <utility>

#include "capture/sim/contact.h"
#include "capture/sim/ray_scene.h"

namespace silhouette::cell_experiment {
namespace {

constexpr uint64_t kStream = uint64_t{1} << 41;  // of chance: apart from other scenes'
constexpr int kRobots = 200;                     // configurations that are tried
constexpr int kPlaces = 2000;                    // places near the robot, for each
constexpr double kFarthest = 0.3;                // metres from the robot's surface
constexpr int kTests = 100;                      // configurations, of which some must touch
constexpr double kLargest = 1.25;                // radius of a ball, as multiple of the least

class Search {
 public:
  // For a place for `ball`.
  Search(const SimulatedWorkplace& workplace, Chance& chance, const Obstacle& ball, double radius)
      : workplace_(workplace),
        chance_(chance),
        ball_(ball),
        radius_(radius),
        contact_(workplace.robot(), {&ball, 1}),
        parts_(RobotParts(workplace.robot())),
        rays_(parts_),
        cameras_(workplace.TrueCalibration().cameras) {}

  // The ball's pose, hidden near the robot at `links`.
  std::optional<Eigen::Isometry3d> Near(const Poses& links) {
    rays_.Place(links);
    for (int i = 0; i < kPlaces; ++i) {
      const BodyPart& part = parts_[static_cast<size_t>(chance_.Below(int(parts_.size())))];
      const Eigen::Vector3d& vertex =
          part.mesh.vertices[static_cast<size_t>(chance_.Below(int(part.mesh.vertices.size())))];
      const Eigen::Vector3d away = chance_.Rotation() * Eigen::Vector3d::UnitZ();
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation() = links[part.frame] * vertex + chance_.Between(0, kFarthest) * away;
      const bool above_floor =
          pose.translation().z() > workplace_.simulation().settings().room.lower.z() + radius_;
      if (!above_floor || !Hidden(pose.translation()) || contact_.Touches(links, {pose})) continue;
      const bool all_hidden =
          std::all_of(ball_.mesh.vertices.begin(), ball_.mesh.vertices.end(),
                      [&](const Eigen::Vector3d& point) { return Hidden(pose * point); });
      if (all_hidden && InTheWay(pose)) return pose;
    }
    return std::nullopt;
  }

 private:
  bool Hidden(const Eigen::Vector3d& point) const {
    return std::all_of(cameras_.begin(), cameras_.end(), [&](const CameraModel& camera) {
      return rays_.Meets(camera.Centre(), point - camera.Centre());
    });
  }

  // Whether the robot touches the ball in some configurations.
  bool InTheWay(const Eigen::Isometry3d& pose) const {
    for (int i = 0; i < kTests; ++i) {
      const Configuration q = RandomConfiguration(chance_, workplace_.cell().grid, true);
      if (contact_.Touches(workplace_.LinkPoses(q), {pose})) return true;
    }
    return false;
  }

  const SimulatedWorkplace& workplace_;
  Chance& chance_;
  const Obstacle& ball_;
  const double radius_;
  const ContactChecker contact_;
  const std::vector<BodyPart> parts_;
  BodyRays rays_;
  const std::vector<CameraModel> cameras_;
};

}  // namespace

std::optional<RandomScene> MakeHiddenScene(const SimulatedWorkplace& workplace, double radius,
                                           uint64_t seed, int number) {
  Chance chance(seed, kStream + static_cast<uint64_t>(number));
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
    const auto pose = search.Near(workplace.LinkPoses(scene.robot));
    if (!pose) continue;
    ball.world_from_obstacle = *pose;
    scene.obstacles = {ball};
    return scene;
  }
  return std::nullopt;
}

}  // namespace silhouette::cell_experiment
