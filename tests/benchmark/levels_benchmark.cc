// SPDX-License-Identifier: Apache-2.0
// The whole configuration space in clearance levels: from a scene to the map and its levels.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "absl/time/time.h"
#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

const std::vector<double> kLevels = {1, 2, 4, 8};

// Verdicts and levels of all tiles, of a scene that nobody has asked about yet.
std::unique_ptr<const ClearanceSpace> LevelsOf(Served served) {
  // Distances of a copy are worked out anew, as those of a new scene are.
  served.scene = std::make_shared<const Scene>(*served.scene);
  auto levels = std::make_unique<const ClearanceSpace>(
      std::make_shared<const ConfigurationSpace>(served, Policy{}), served, Policy{}, kLevels);
  for (uint64_t tile = 0; tile < levels->verdicts()->tiles(); ++tile) levels->tile(tile);
  return levels;
}

// Whether every 97th tile is what the meter measures singly.
bool LevelsIsRight(const ClearanceSpace& levels, const Served& served) {
  const Checker checker(served, Policy{}, {.max_age = absl::InfiniteDuration()},
                        served.scene->arrived);
  const auto meter = checker.Clearances();
  if (!meter) return false;
  const LevelChecker singly(*meter, kLevels);
  for (uint64_t tile = 0; tile < levels.verdicts()->tiles(); tile += 97) {
    const PlaceSet free{levels.verdicts()->tile(tile).free};
    const std::vector<PlaceSet> measured = singly.Above(tile, nullptr, free);
    const auto told = levels.tile(tile);
    if (!std::equal(measured.begin(), measured.end(), told.begin(), told.end())) return false;
  }
  return true;
}

void SceneToLevels(benchmark::State& state, SceneKind kind) {
  const std::vector<Served>& scenes = ServedScenesOf1M(kind);
  MeasureScenes(state, scenes.size(), Caches::kWarm,
                [&](size_t i) { benchmark::DoNotOptimize(LevelsOf(scenes[i])); });
  if (!LevelsIsRight(*LevelsOf(scenes.back()), scenes.back()))
    state.SkipWithError("a level is wrong");
}

const bool kLevelsRegistered = [] {
  for (const SceneKind kind : kSceneKinds) {
    benchmark::RegisterBenchmark(("levels_1m/" + NameOf(kind)).c_str(), SceneToLevels, kind)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
