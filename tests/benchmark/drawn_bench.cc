// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/drawn_bench.h"

#include <cmath>
#include <ctime>
#include <numbers>
#include <random>
#include <utility>

#include "calib/robot/parts.h"
#include "tests/folders.h"

namespace silhouette::benchmarks {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using DrawnRandom = std::mt19937_64;

constexpr double kDrawnTolerance = 0.005;
constexpr double kDrawnMargin = 0.25;  // pixels, the server's default

double Any(DrawnRandom& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

// Upright; x to the right, y down, z along the view.
CameraModel CameraAt(const Vector3d& centre, const Vector3d& target) {
  Isometry3d world_from_camera = Isometry3d::Identity();
  const Vector3d along = (target - centre).normalized();
  const Vector3d right = along.cross(Vector3d::UnitZ()).normalized();
  world_from_camera.linear() << right, along.cross(right), along;
  world_from_camera.translation() = centre;
  const CameraIntrinsics in{.width = 64, .height = 64, .fx = 78, .fy = 78, .cx = 31.5, .cy = 31.5};
  return {in, world_from_camera.inverse()};
}

Obstacle MakeObstacle(Thing thing, DrawnRandom& random) {
  Obstacle obstacle{.thing = thing};
  const double angle = Any(random, -std::numbers::pi, std::numbers::pi);
  const bool person = thing == Thing::kPerson;
  const double away = person ? Any(random, 0.8, 1.5) : Any(random, 0.4, 1.1);
  obstacle.half = person ? Vector3d(0.22, 0.22, 0.875) : Vector3d(0.09, 0.05, 0.04);
  obstacle.pose.translation() = Vector3d(away * std::cos(angle), away * std::sin(angle),
                                         person ? 0.875 : Any(random, 0.3, 1.5));
  obstacle.pose.linear() = Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
  return obstacle;
}

RobotModel DrawnModel() {
  return RobotModel::FromUrdf(SourceFolder() + "/capture/sim/robots/rx130.urdf").value();
}

}  // namespace

std::string NameOf(Thing thing) { return thing == Thing::kPerson ? "person" : "hand"; }

Eigen::Matrix3Xd Obstacle::Points() const {
  const int corners = thing == Thing::kPerson ? 32 : 4;
  const double out = 1 / std::cos(std::numbers::pi / corners);
  Eigen::Matrix3Xd points(3, 2 * corners);
  for (int i = 0; i < 2 * corners; ++i) {
    const double angle = 2 * std::numbers::pi * (i / 2 + 0.5) / corners;
    points.col(i) = Vector3d(half.x() * out * std::cos(angle), half.y() * out * std::sin(angle),
                             i % 2 == 0 ? half.z() : -half.z());
  }
  return points;
}

bool Obstacle::Meets(const Vector3d& point) const {
  const Vector3d p = (pose.inverse() * point).cwiseAbs();
  const double margin = 0.87 * kDrawnVoxel;
  if (p.z() > half.z() + margin) return false;
  if (thing == Thing::kPerson) return p.head<2>().norm() <= half.x() + margin;
  return p.x() <= half.x() + margin && p.y() <= half.y() + margin;
}

const DrawnBench& TheDrawnBench() {
  static const DrawnBench bench = [] {
    DrawnBench made{DrawnModel(), nullptr, nullptr, {}, {}, {}, {}};
    std::vector<RobotPart> parts = RobotParts::Of(made.model, {}).value().parts();
    for (RobotPart& part : parts) part.radius += kDrawnTolerance;
    std::vector<PartDrawer> views;
    for (int i = 0; i < 4; ++i) {
      const double angle = std::numbers::pi * (0.25 + 0.5 * i);
      const Vector3d target(0, 0, 0.7);
      const Vector3d out(std::cos(angle) * 0.9, std::sin(angle) * 0.9, 0.436);
      views.emplace_back(CameraAt(target + 4.2 * out.normalized(), target), MaskSize{64, 64},
                         kDrawnMargin);
    }
    std::vector<std::string> moving;
    for (const RobotJoint& joint : made.model.joints()) moving.push_back(joint.name);
    const KinematicChain chain = made.model.ChainOf(moving, {}).value();
    made.whole = std::make_shared<const DrawnRobot>(chain, parts, views);
    std::erase_if(parts, [](const RobotPart& part) { return part.link == 0; });
    made.robot = std::make_shared<const DrawnRobot>(chain, std::move(parts), std::move(views));
    DrawnRandom random;
    for (const Thing thing : kThings) {
      const auto kind = static_cast<size_t>(thing);
      for (int i = 0; i < kDrawnScenes; ++i) {
        const Obstacle obstacle = MakeObstacle(thing, random);
        std::vector<std::optional<Mask>> planes;
        DrawingScratch scratch;
        for (const PartDrawer& view : made.robot->views()) {
          std::vector<uint64_t> words(view.size().words());
          view.AddTouched(obstacle.pose, obstacle.Points(), {}, 0, scratch, words);
          planes.emplace_back(Mask::FromWords(view.size(), std::move(words)));
        }
        made.obstacles[kind].push_back(obstacle);
        made.checkers[kind].emplace_back(made.robot, planes);
        made.planes[kind].push_back(std::move(planes));
      }
    }
    for (int i = 0; i < 4000; ++i) {
      std::vector<double>& q = made.questions.emplace_back();
      for (const RobotJoint& joint : made.model.joints()) {
        q.push_back(Any(random, joint.lower, joint.upper));
      }
    }
    return made;
  }();
  return bench;
}

double ThreadSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace silhouette::benchmarks
