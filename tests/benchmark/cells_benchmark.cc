// SPDX-License-Identifier: Apache-2.0
// From a scene to the free cells of the whole grid, by which clients tell of configurations off the
// grid.
#include <benchmark/benchmark.h>

#include <bit>
#include <memory>
#include <numeric>
#include <vector>

#include "absl/time/time.h"
#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

// The cells of all tiles and nothing else.
std::unique_ptr<const ConfigurationSpace> CellsOf(const Served& served) {
  auto space = std::make_unique<const ConfigurationSpace>(served, Policy{});
  std::vector<uint64_t> tiles(space->tiles());
  std::iota(tiles.begin(), tiles.end(), uint64_t{0});
  space->WorkOutCells(tiles, [] { return false; });
  return space;
}

// Whether the middle of some cells is what the checker says of it.
bool CellsIsRight(const ConfigurationSpace& space, const Served& served) {
  const Checker checker(served, Policy{}, {.max_age = absl::InfiniteDuration()},
                        served.scene->arrived);
  const ConfigurationGrid& grid = GridOf1M();
  for (const ConfigurationNumber number : RandomNumbers(grid, 2000)) {
    const GridIndex low = *grid.IndexOf(number);
    Configuration q = grid.At(low);
    for (size_t j = 0; j < q.size(); ++j) {
      const GridJoint& joint = grid.joints()[j];
      if (joint.continuous || low[j] + 1 < joint.steps) q[j] += 0.5 * joint.step();
    }
    const bool free = space.free_cells(number / kTileSize).Contains(number % kTileSize);
    if (checker.Check(q).free() != free) return false;
  }
  return true;
}

double FreeShare(const ConfigurationSpace& space) {
  double free = 0;
  for (uint64_t tile = 0; tile < space.tiles(); ++tile) {
    for (const uint64_t word : space.free_cells(tile).words) free += std::popcount(word);
  }
  return free / static_cast<double>(GridOf1M().size());
}

void SceneToCells(benchmark::State& state, SceneKind kind) {
  const std::vector<Served>& scenes = ServedScenesOf1M(kind);
  MeasureScenes(state, scenes.size(), Caches::kWarm,
                [&](size_t i) { benchmark::DoNotOptimize(CellsOf(scenes[i])); });
  const std::unique_ptr<const ConfigurationSpace> space = CellsOf(scenes.back());
  if (!space->cells_exact() || !CellsIsRight(*space, scenes.back())) {
    state.SkipWithError("a cell is wrong");
  }
  state.counters["free_share"] = FreeShare(*space);
}

const bool kCellsRegistered = [] {
  for (const SceneKind kind : kSceneKinds) {
    benchmark::RegisterBenchmark(("cells_1m/" + NameOf(kind)).c_str(), SceneToCells, kind)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
