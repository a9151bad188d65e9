// SPDX-License-Identifier: Apache-2.0
// Baseline: the usual way. FCL tests the arm's seven capsules, exactly, against an OctoMap octree
// of the same obstacles, voxels of 2 cm.
#include <benchmark/benchmark.h>
#include <fcl/fcl.h>
#include <octomap/octomap.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

using Eigen::Vector3d;

constexpr double kVoxel = 0.02;    // metres
constexpr double kFarthest = 6.0;  // metres that a depth camera sees
constexpr int kDepthPixels = 64;   // along each side of a depth image, as many as the masks have

octomap::point3d ToOctomap(const Vector3d& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

// Occupied wherever an obstacle is; everything else stays unknown.
std::shared_ptr<octomap::OcTree> TreeOf(const std::vector<Capsule>& obstacles) {
  auto tree = std::make_shared<octomap::OcTree>(kVoxel);
  for (const Capsule& capsule : obstacles) {
    const Vector3d margin = Vector3d::Constant(capsule.radius);
    const octomap::OcTreeKey low =
        tree->coordToKey(ToOctomap(capsule.from.cwiseMin(capsule.to) - margin));
    const octomap::OcTreeKey high =
        tree->coordToKey(ToOctomap(capsule.from.cwiseMax(capsule.to) + margin));
    for (unsigned x = low[0]; x <= high[0]; ++x) {
      for (unsigned y = low[1]; y <= high[1]; ++y) {
        for (unsigned z = low[2]; z <= high[2]; ++z) {
          const octomap::OcTreeKey key(static_cast<octomap::key_type>(x),
                                       static_cast<octomap::key_type>(y),
                                       static_cast<octomap::key_type>(z));
          const octomap::point3d centre = tree->keyToCoord(key);
          // Half a diagonal: a voxel that the obstacle only touches counts.
          if (DistanceTo(capsule, {centre.x(), centre.y(), centre.z()}) < 0.87 * kVoxel) {
            tree->updateNode(key, true, true);
          }
        }
      }
    }
  }
  tree->updateInnerOccupancy();
  tree->prune();
  return tree;
}

// Where a depth camera's ray ends: at an obstacle, or at the end of its range.
Vector3d EndOfRay(const std::vector<Capsule>& obstacles, const Vector3d& from,
                  const Vector3d& ray) {
  double way = 0;
  while (way < kFarthest) {
    double nearest = kFarthest;
    for (const Capsule& capsule : obstacles) {
      nearest = std::min(nearest, DistanceTo(capsule, from + way * ray));
    }
    if (nearest < 1e-3) break;
    way += nearest;
  }
  return from + std::min(way, kFarthest) * ray;
}

struct DepthImage {
  octomap::point3d camera;
  octomap::Pointcloud points;
};

std::vector<DepthImage> DepthImagesOf(const SyntheticCell& cell, const BenchmarkScene& scene) {
  std::vector<DepthImage> images;
  for (const PinholeView& view : cell.views()) {
    DepthImage& image = images.emplace_back();
    image.camera = ToOctomap(view.centre());
    for (int y = 0; y < kDepthPixels; ++y) {
      for (int x = 0; x < kDepthPixels; ++x) {
        const Vector3d ray = view.Ray((x + 0.5) * view.size().width / kDepthPixels,
                                      (y + 0.5) * view.size().height / kDepthPixels);
        image.points.push_back(ToOctomap(EndOfRay(scene.obstacles, view.centre(), ray)));
      }
    }
  }
  return images;
}

class FclChecker {
 public:
  FclChecker(const SyntheticCell& cell, const BenchmarkScene& scene)
      : cell_(cell), octree_(TreeOf(scene.obstacles)) {
    octree_.computeLocalAABB();
    for (const Capsule& link : cell.RobotAt(scene.robot)) {
      links_.push_back(std::make_unique<fcl::Capsuled>(link.radius, (link.to - link.from).norm()));
      links_.back()->computeLocalAABB();
    }
  }

  // The links' places are worked out too: a planner has joint values.
  bool Occupied(const Configuration& q) const {
    const std::array<Capsule, kLinks> links = cell_.RobotAt(q);
    for (size_t i = 0; i < kLinks; ++i) {
      const Vector3d axis = links[i].to - links[i].from;
      fcl::Transform3d pose = fcl::Transform3d::Identity();
      pose.linear() =
          Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
      pose.translation() = (links[i].from + links[i].to) / 2;
      fcl::CollisionResultd result;
      if (fcl::collide<double>(links_[i].get(), pose, &octree_, fcl::Transform3d::Identity(),
                               fcl::CollisionRequestd(1, false), result) > 0) {
        return true;
      }
    }
    return false;
  }

 private:
  const SyntheticCell& cell_;
  fcl::OcTreed octree_;
  std::vector<std::unique_ptr<fcl::Capsuled>> links_;
};

// Over all scenes of a kind.
void FclCheck(benchmark::State& state, SceneKind kind) {
  constexpr int kChecks = 250;  // per scene
  const SyntheticCell& cell = TheCellOf1M().cell;
  std::vector<std::unique_ptr<FclChecker>> checks;
  for (const BenchmarkScene& scene : ScenesOf1M(kind)) {
    checks.push_back(std::make_unique<FclChecker>(cell, scene));
  }
  const int count = static_cast<int>(checks.size()) * kChecks;
  std::vector<Configuration> configurations;
  for (const ConfigurationNumber number : RandomNumbers(cell.grid(), count)) {
    configurations.push_back(cell.grid().At(number));
  }
  std::vector<char> occupied(configurations.size());
  MeasureCalls(state, count, [&](int i) {
    const auto place = static_cast<size_t>(i);
    occupied[place] = checks[place / kChecks]->Occupied(configurations[place]) ? 1 : 0;
  });
  state.counters["occupied_share"] =
      static_cast<double>(std::count(occupied.begin(), occupied.end(), 1)) / count;
}

// A new octree of the obstacles, whose voxels are known.
void NewTree(benchmark::State& state, SceneKind kind) {
  const std::vector<BenchmarkScene>& scenes = ScenesOf1M(kind);
  MeasureScenes(state, scenes.size(), Caches::kWarm,
                [&](size_t i) { benchmark::DoNotOptimize(TreeOf(scenes[i].obstacles)); });
}

// The depth images of the four cameras put into an octree of the workspace that has seen the scene
// before: rays make voxels free, ends make them occupied. Two scenes of each kind: it takes
// seconds.
void DepthUpdate(benchmark::State& state, SceneKind kind) {
  const std::vector<BenchmarkScene>& scenes = ScenesOf1M(kind);
  std::vector<std::vector<DepthImage>> images;
  for (const BenchmarkScene& scene : scenes)
    images.push_back(DepthImagesOf(TheCellOf1M().cell, scene));
  octomap::OcTree tree(kVoxel);
  tree.useBBXLimit(true);
  octomap::point3d low(-2, -2, 0);
  octomap::point3d high(2, 2, 2.2F);
  tree.setBBXMin(low);
  tree.setBBXMax(high);
  const auto insert = [&](const std::vector<DepthImage>& seen) {
    for (const DepthImage& image : seen) {
      tree.insertPointCloud(image.points, image.camera, kFarthest - 0.01, true, true);
    }
    tree.updateInnerOccupancy();
  };
  insert(images[0]);
  MeasureScenes(state, scenes.size(), Caches::kWarm, [&](size_t i) { insert(images[i]); });
}

void Register(SceneKind kind) {
  const std::string name = NameOf(kind);
  benchmark::RegisterBenchmark(("fcl_octomap_check/" + name).c_str(), FclCheck, kind)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark(("octomap_new_tree/" + name).c_str(), NewTree, kind)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark(("octomap_depth_update/" + name).c_str(), DepthUpdate, kind)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

const bool kFclRegistered = [] {
  for (const SceneKind kind : kSceneKinds) Register(kind);
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
