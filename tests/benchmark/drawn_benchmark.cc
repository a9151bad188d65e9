// SPDX-License-Identifier: Apache-2.0
// A robot of six joints that is drawn at any joint values, against FCL and an OctoMap octree with
// the same moving links.
//
// The RX130, four views of 64 x 64 pixels 4.2 m away that show its whole reach. Scenes: a person's
// cylinder, or a box of a hand's size, within reach. The planes are all that these touch.
#include <benchmark/benchmark.h>
#include <fcl/fcl.h>
#include <octomap/octomap.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "calib/robot/drawing/drawn_checker.h"
#include "calib/robot/drawing/motion_check.h"
#include "calib/robot/parts.h"
#include "calib/robot/robot_model.h"
#include "tests/folders.h"

namespace silhouette::benchmarks {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using DrawnRandom = std::mt19937_64;

constexpr int kDrawnScenes = 8;  // of a kind
constexpr double kDrawnVoxel = 0.02;
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

enum class Thing { kPerson, kHand };

// A cylinder or box, upright.
struct Obstacle {
  Thing thing = Thing::kPerson;
  Isometry3d pose = Isometry3d::Identity();
  Vector3d half = Vector3d::Zero();  // x and y: the cylinder's radius

  Eigen::Matrix3Xd Points() const {
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

  // Whether it meets a voxel about `point`, or nearly.
  bool Meets(const Vector3d& point) const {
    const Vector3d p = (pose.inverse() * point).cwiseAbs();
    const double margin = 0.87 * kDrawnVoxel;
    if (p.z() > half.z() + margin) return false;
    if (thing == Thing::kPerson) return p.head<2>().norm() <= half.x() + margin;
    return p.x() <= half.x() + margin && p.y() <= half.y() + margin;
  }
};

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

struct DrawnBench {
  RobotModel model = DrawnModel();
  std::shared_ptr<const DrawnRobot> robot;  // of its moving links
  std::vector<Obstacle> obstacles[2];
  std::vector<DrawnChecker> checkers[2];
  std::vector<std::vector<std::optional<Mask>>> planes[2];
  std::vector<std::vector<double>> questions;  // joint values
};

const DrawnBench& TheDrawnBench() {
  static const DrawnBench bench = [] {
    DrawnBench made;
    std::vector<RobotPart> parts = RobotParts::Of(made.model, {}).value().parts();
    std::erase_if(parts, [](const RobotPart& part) { return part.link == 0; });
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
    made.robot = std::make_shared<const DrawnRobot>(made.model.ChainOf(moving, {}).value(),
                                                    std::move(parts), std::move(views));
    DrawnRandom random;
    for (const Thing thing : {Thing::kPerson, Thing::kHand}) {
      const auto kind = static_cast<size_t>(thing);
      for (int i = 0; i < kDrawnScenes; ++i) {
        const Obstacle obstacle = MakeObstacle(thing, random);
        std::vector<std::optional<Mask>> planes;
        DrawingScratch scratch;
        for (const PartDrawer& view : made.robot->views()) {
          std::vector<uint64_t> words(view.size().words());
          view.AddTouched(obstacle.pose, obstacle.Points(), 0, scratch, words);
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

// Counter mean_ns: of one of `count` calls of ask(i), time of the processor; per_second: of them.
template <typename Ask>
void MeasureMean(benchmark::State& state, size_t count, Ask ask) {
  double least = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const double begin = ThreadSeconds();
    for (size_t i = 0; i < count; ++i) ask(i);
    const double time = ThreadSeconds() - begin;
    least = std::min(least, time);
    state.SetIterationTime(time);
  }
  state.counters["mean_ns"] = least * 1e9 / static_cast<double>(count);
  state.counters["per_second"] = static_cast<double>(count) / least;
}

bool ByMasks(const DrawnBench& bench, Thing thing, size_t scene, size_t question, int min_views) {
  const auto& planes = bench.planes[static_cast<size_t>(thing)][scene];
  const std::vector<Mask> masks = bench.robot->Touched(bench.questions[question]);
  int showing = 0;
  for (size_t view = 0; view < masks.size(); ++view) {
    if (Intersects(masks[view].words(), planes[view]->words())) ++showing;
  }
  return showing >= min_views;
}

void CheckAnyQ(benchmark::State& state, Thing thing, int min_views) {
  const DrawnBench& bench = TheDrawnBench();
  const auto& checkers = bench.checkers[static_cast<size_t>(thing)];
  const size_t count = checkers.size() * bench.questions.size();
  DrawnCheckScratch scratch;
  const auto occupied = [&](size_t i) {
    return checkers[i / bench.questions.size()].Showing(bench.questions[i % bench.questions.size()],
                                                        {}, min_views, scratch) >= min_views;
  };
  for (size_t i = 0; i < count; i += 53) {
    if (occupied(i) !=
        ByMasks(bench, thing, i / bench.questions.size(), i % bench.questions.size(), min_views)) {
      state.SkipWithError("not as the drawn masks");
      return;
    }
  }
  size_t hits = 0;
  MeasureMean(state, count, [&](size_t i) { hits += occupied(i) ? 1 : 0; });
  state.counters["occupied_share"] = static_cast<double>(hits) /
                                     static_cast<double>(state.iterations()) /
                                     static_cast<double>(count);
}

void MotionAnyQ(benchmark::State& state, Thing thing) {
  constexpr double kMetres = 0.5;
  constexpr int kMinViews = 3;
  const DrawnBench& bench = TheDrawnBench();
  const auto& checkers = bench.checkers[static_cast<size_t>(thing)];
  std::vector<std::vector<double>> ends;
  for (size_t i = 0; i < bench.questions.size(); ++i) {
    const std::vector<double>& from = bench.questions[i];
    const std::vector<double>& towards = bench.questions[(i + 1) % bench.questions.size()];
    const double share = kMetres / GreatestDisplacement(*bench.robot, from, towards);
    std::vector<double>& to = ends.emplace_back();
    for (size_t j = 0; j < from.size(); ++j) {
      to.push_back(from[j] + std::min(share, 1.0) * (towards[j] - from[j]));
    }
  }
  DrawnCheckScratch scratch;
  double free = 0;
  double proven = 0;
  double checks = 0;
  MeasureMean(state, bench.questions.size(), [&](size_t i) {
    const DrawnChecker& checker = checkers[i % checkers.size()];
    const MotionCheck check =
        CheckMotion(*bench.robot, bench.questions[i], ends[i], kMotionResolution,
                    [&](const MotionPlace& place) {
                      return !checker.ShownBy(kMinViews, place.q, place.growth, scratch);
                    });
    free += check.free ? 1 : 0;
    proven += check.free && check.sampled_step == 0 ? 1 : 0;
    checks += check.checks;
  });
  const double all =
      static_cast<double>(state.iterations()) * static_cast<double>(bench.questions.size());
  state.counters["free_share"] = free / all;
  state.counters["proven_share_of_free"] = proven / std::max(free, 1.0);
  state.counters["checks"] = checks / all;
}

void DrawMask(benchmark::State& state) {
  const DrawnBench& bench = TheDrawnBench();
  std::vector<std::vector<Isometry3d>> poses(bench.questions.size());
  for (size_t i = 0; i < poses.size(); ++i) bench.robot->chain().Pose(bench.questions[i], poses[i]);
  DrawingScratch scratch;
  std::vector<uint64_t> words(64);
  MeasureMean(state, 4 * poses.size(), [&](size_t i) {
    std::ranges::fill(words, 0);
    bench.robot->AddTouched(i % 4, poses[i / 4], {}, scratch, words);
    benchmark::DoNotOptimize(words.data());
  });
}

// What a new scene costs before the first question.
void DrawnSceneCost(benchmark::State& state) {
  const DrawnBench& bench = TheDrawnBench();
  MeasureMean(state, kDrawnScenes, [&](size_t i) {
    benchmark::DoNotOptimize(DrawnChecker(bench.robot, bench.planes[0][i]));
  });
}

// A capsule about z, or a sphere, about a box of these edges; `turn` takes it into the box's frame.
std::shared_ptr<fcl::CollisionGeometryd> CapsuleAbout(const Vector3d& edges,
                                                      Eigen::Matrix3d& turn) {
  Eigen::Index longest = 0;
  edges.maxCoeff(&longest);
  const Vector3d along = Vector3d::Unit(longest);
  turn = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), along).toRotationMatrix();
  const double radius = std::sqrt(edges.squaredNorm() - edges[longest] * edges[longest]) / 2;
  return std::make_shared<fcl::Capsuled>(radius, edges[longest]);
}

// What stands for robot and obstacle.
enum class Baseline {
  kExact,     // the links' boxes and cylinders, an octree of all that is occupied
  kCapsules,  // a capsule about each of them, an octree of the points of the obstacle's surface
};

// The same moving links.
class FclOfDrawn {
 public:
  FclOfDrawn(const DrawnBench& bench, const Obstacle& obstacle, Baseline baseline)
      : bench_(bench), octree_(TreeOf(obstacle, baseline)) {
    octree_.computeLocalAABB();
    for (size_t link = 1; link < bench.model.links().size(); ++link) {
      for (const LinkGeometry& geometry : bench.model.links()[link].body()) {
        std::shared_ptr<fcl::CollisionGeometryd> shape;
        if (const auto* box = std::get_if<BoxShape>(&geometry.shape)) {
          shape = std::make_shared<fcl::Boxd>(box->size);
        } else {
          const auto& cylinder = std::get<CylinderShape>(geometry.shape);
          shape = std::make_shared<fcl::Cylinderd>(cylinder.radius, cylinder.length);
        }
        Isometry3d link_from_shape = geometry.link_from_shape;
        if (baseline == Baseline::kCapsules) {
          Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
          if (const auto* box = std::get_if<BoxShape>(&geometry.shape)) {
            shape = CapsuleAbout(box->size, turn);
          } else {
            const auto& cylinder = std::get<CylinderShape>(geometry.shape);
            shape = std::make_shared<fcl::Capsuled>(cylinder.radius, cylinder.length);
          }
          link_from_shape.linear() = (link_from_shape.linear() * turn).eval();
        }
        shape->computeLocalAABB();
        shapes_.push_back({link, link_from_shape, std::move(shape)});
      }
    }
  }

  bool Occupied(std::span<const double> q) {
    bench_.robot->chain().Pose(q, poses_);
    for (const Shape& shape : shapes_) {
      fcl::CollisionResultd result;
      if (fcl::collide<double>(shape.geometry.get(), poses_[shape.link] * shape.link_from_shape,
                               &octree_, fcl::Transform3d::Identity(),
                               fcl::CollisionRequestd(1, false), result) > 0) {
        return true;
      }
    }
    return false;
  }

 private:
  struct Shape {
    size_t link = 0;
    Isometry3d link_from_shape;
    std::shared_ptr<fcl::CollisionGeometryd> geometry;
  };

  static std::shared_ptr<octomap::OcTree> TreeOf(const Obstacle& obstacle, Baseline baseline) {
    auto tree = std::make_shared<octomap::OcTree>(kDrawnVoxel);
    const double round = obstacle.half.norm() + kDrawnVoxel;
    for (double x = -round; x <= round; x += kDrawnVoxel) {
      for (double y = -round; y <= round; y += kDrawnVoxel) {
        for (double z = -round; z <= round; z += kDrawnVoxel) {
          const Vector3d at = obstacle.pose.translation() + Vector3d(x, y, z);
          const octomap::OcTreeKey key = tree->coordToKey(at.x(), at.y(), at.z());
          const octomap::point3d centre = tree->keyToCoord(key);
          const Vector3d voxel(centre.x(), centre.y(), centre.z());
          bool within = baseline == Baseline::kCapsules;
          for (int side = 0; side < 6; ++side) {
            const double step = side % 2 == 0 ? kDrawnVoxel : -kDrawnVoxel;
            within = within && obstacle.Meets(voxel + step * Vector3d::Unit(side / 2));
          }
          if (obstacle.Meets(voxel) && !within) tree->updateNode(key, true, true);
        }
      }
    }
    tree->updateInnerOccupancy();
    tree->prune();
    return tree;
  }

  const DrawnBench& bench_;
  fcl::OcTreed octree_;
  std::vector<Shape> shapes_;
  std::vector<Isometry3d> poses_;
};

void FclAnyQ(benchmark::State& state, Thing thing, Baseline baseline) {
  const DrawnBench& bench = TheDrawnBench();
  std::vector<std::unique_ptr<FclOfDrawn>> checks;
  for (const Obstacle& obstacle : bench.obstacles[static_cast<size_t>(thing)]) {
    checks.push_back(std::make_unique<FclOfDrawn>(bench, obstacle, baseline));
  }
  size_t hits = 0;
  const size_t count = checks.size() * 500;
  MeasureMean(state, count, [&](size_t i) {
    hits += checks[i / 500]->Occupied(bench.questions[i % 500]) ? 1 : 0;
  });
  state.counters["occupied_share"] = static_cast<double>(hits) /
                                     static_cast<double>(state.iterations()) /
                                     static_cast<double>(count);
}

const bool kDrawnRegistered = [] {
  const auto add = [](const std::string& name, auto function, auto... arguments) {
    benchmark::RegisterBenchmark(name.c_str(), function, arguments...)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  for (const Thing thing : {Thing::kPerson, Thing::kHand}) {
    const std::string name = thing == Thing::kPerson ? "/person" : "/hand";
    add("fcl_octomap_any_q" + name, FclAnyQ, thing, Baseline::kExact);
    add("fcl_capsules_any_q" + name, FclAnyQ, thing, Baseline::kCapsules);
    add("check_any_q" + name + "/3", CheckAnyQ, thing, 3);
    add("check_any_q" + name + "/4", CheckAnyQ, thing, 4);
    add("motion_any_q" + name, MotionAnyQ, thing);
  }
  add("draw_mask", DrawMask);
  add("drawn_scene", DrawnSceneCost);
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
