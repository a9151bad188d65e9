// SPDX-License-Identifier: Apache-2.0
// A robot of six joints that is drawn at any joint values, against FCL and an OctoMap octree with
// the same moving links.
#include <benchmark/benchmark.h>
#include <fcl/fcl.h>
#include <octomap/octomap.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "calib/robot/drawing/drawn_checker.h"
#include "calib/robot/drawing/motion_check.h"
#include "tests/benchmark/drawn_bench.h"

namespace silhouette::benchmarks {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

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
  for (const Thing thing : kThings) {
    const std::string name = "/" + NameOf(thing);
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
