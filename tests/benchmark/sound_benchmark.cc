// SPDX-License-Identifier: Apache-2.0
// The sound test on one scene: a cube of 2 m at voxels of 1.5 cm, seen by four cameras. Beside it
// the plain way, voxel by voxel, that it is to be measured against.
#include <benchmark/benchmark.h>

#include <map>
#include <memory>
#include <numbers>

#include "tests/server/collision/certain_pixels.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

using testing::BallCamera;
using testing::Balls;
using testing::LookingAt;
using testing::Vector2d;
using testing::Vector3d;

constexpr double kEdge = 0.015;
constexpr double kRho = 0.045;
constexpr int kOccludedViews = 1;

// An arm of about 0.9 m, from its base outward.
Balls BallRobot() {
  const Vector3d elbow(0.3, 0.1, 0.32);
  const Vector3d hand(0.72, -0.2, 0.1);
  Balls robot;
  for (int i = 0; i <= 6; ++i) robot.push_back({i / 6.0 * elbow, 0.08});
  for (int i = 1; i <= 8; ++i) robot.push_back({elbow + i / 8.0 * (hand - elbow), 0.06});
  return robot;
}

// A person's trunk and arm, and a box of the size of a hand.
Balls SoundObstacles() {
  Balls obstacles;
  for (int i = 0; i < 8; ++i) obstacles.push_back({Vector3d(-0.55, 0.5, -0.8 + 0.2 * i), 0.18});
  for (int i = 0; i < 6; ++i) obstacles.push_back({Vector3d(-0.4 + 0.08 * i, 0.4, 0.3), 0.06});
  obstacles.push_back({Vector3d(0.5, 0.45, -0.3), 0.07});
  return obstacles;
}

struct BallScene {
  explicit BallScene(int pixels) {
    std::vector<VoxelView> views;
    for (const Vector3d& from : {Vector3d(3.2, 2.4, 1.2), Vector3d(-2.8, 2.7, 1.5),
                                 Vector3d(-2.5, -3.0, 1.0), Vector3d(1.0, -1.2, 3.8)}) {
      const BallCamera camera(LookingAt(from, {0, 0, 0}, {pixels, pixels}, 0.95, -0.1));
      views.push_back({camera.size(), camera.project(), Vector2d::Zero(), Mask()});
      const Mask robot = camera.See(BallRobot());
      images.push_back(ObstacleImage::FromScene(camera.See(SoundObstacles()) | robot, robot));
    }
    space = std::make_unique<VoxelSpace>(
        Eigen::AlignedBox3d(Vector3d::Constant(-1), Vector3d::Constant(1)), kRho, views, kEdge);
  }

  ObstacleImages images;
  std::unique_ptr<VoxelSpace> space;
  BodyDistance body = [robot = BallRobot()](const Vector3d& point) {
    return testing::DistanceTo(robot, point);
  };
};

const BallScene& SceneOf(int pixels) {
  static std::map<int, BallScene> scenes;
  return scenes.try_emplace(pixels, pixels).first->second;
}

// Whether any pixel of the rectangle is set.
bool AnySet(const Mask& mask, const PixelRectangle& pixels) {
  for (int y = pixels.y; y < pixels.y + pixels.height; ++y) {
    for (int x = pixels.x; x < pixels.x + pixels.width; ++x) {
      if (mask.at(x, y)) return true;
    }
  }
  return false;
}

// What remains, by the definition.
VoxelSet PlainRemaining(const BallScene& scene) {
  const VoxelSpace& space = *scene.space;
  const VoxelGrid& grid = space.grid();
  std::vector<Mask> foregrounds;
  for (const auto& image : scene.images) foregrounds.push_back(~image->Background());
  const auto views = static_cast<size_t>(space.views());
  const auto may_be = [&](int x, int y, int z) {
    for (size_t view = 0; view < views; ++view) {
      const PixelRectangle pixels = space.Touched(static_cast<int>(view), x, y, z);
      if (pixels.whole && !AnySet(foregrounds[view], pixels)) return false;
    }
    return true;
  };
  const auto may_be_centre = [&](int x, int y, int z) {
    for (size_t view = 0; view < views; ++view) {
      for (const auto& [px, py] : testing::CertainPixels(space, static_cast<int>(view), x, y, z)) {
        if (!foregrounds[view].at(px, py)) return false;
      }
    }
    return true;
  };
  const int reach = static_cast<int>(kRho / kEdge) + 1;
  VoxelSet possible(grid);
  VoxelSet opened(grid);
  VoxelSet plain(grid);
  const auto fill_ball = [&](int x, int y, int z) {
    const Eigen::AlignedBox3d centre = grid.Box(x, y, z);
    for (int bz = std::max(0, z - reach); bz <= std::min(grid.size(2) - 1, z + reach); ++bz) {
      for (int by = std::max(0, y - reach); by <= std::min(grid.size(1) - 1, y + reach); ++by) {
        for (int bx = std::max(0, x - reach); bx <= std::min(grid.size(0) - 1, x + reach); ++bx) {
          if (grid.Box(bx, by, bz).exteriorDistance(centre) <= kRho + 1e-9)
            opened.Insert(bx, by, bz);
        }
      }
    }
  };
  for (int z = 0; z < grid.size(2); ++z) {
    for (int y = 0; y < grid.size(1); ++y) {
      for (int x = 0; x < grid.size(0); ++x) {
        if (!may_be(x, y, z) || testing::WhollyBelow(scene.body, grid.Box(x, y, z), 0)) continue;
        possible.Insert(x, y, z);
        int shown = 0;
        int occluded = 0;
        for (size_t view = 0; view < views; ++view) {
          const PixelRectangle pixels = space.Touched(static_cast<int>(view), x, y, z);
          if (!pixels.whole) continue;
          (AnySet(scene.images[view]->obstacle(), pixels) ? shown : occluded) += 1;
        }
        if (shown > 0 && occluded <= kOccludedViews) plain.Insert(x, y, z);
        if (may_be_centre(x, y, z) && !testing::WhollyBelow(scene.body, grid.Box(x, y, z), kRho)) {
          fill_ball(x, y, z);
        }
      }
    }
  }
  for (size_t i = 0; i < opened.words().size(); ++i) {
    opened.words()[i] =
        ((opened.words()[i] & possible.words()[i]) | plain.words()[i]) & space.reached().words()[i];
  }
  return opened;
}

void BM_Sound_PossibleSpace(benchmark::State& state) {
  const BallScene& scene = SceneOf(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        PossibleSpace(*scene.space, scene.images, scene.body, {}, kOccludedViews));
  }
  state.counters["voxels"] = static_cast<double>(scene.space->grid().voxels());
}

void BM_Sound_PlainVoxelByVoxel(benchmark::State& state) {
  const BallScene& scene = SceneOf(static_cast<int>(state.range(0)));
  VoxelSet remaining;
  for (auto _ : state) benchmark::DoNotOptimize(remaining = PlainRemaining(scene));
  const PossibleSpace possible(*scene.space, scene.images, scene.body, {}, kOccludedViews);
  if (!(remaining == possible.remaining())) state.SkipWithError("the results are not the same");
}

BENCHMARK(BM_Sound_PossibleSpace)->Arg(64)->Arg(128)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Sound_PlainVoxelByVoxel)->Arg(64)->Arg(128)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace silhouette
