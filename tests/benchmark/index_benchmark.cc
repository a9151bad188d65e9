// The collision index: building it, its size, and from a scene to the map of the whole
// configuration space.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>
#include <vector>

#include "server/collision/collision_test.h"
#include "server/collision/space_test.h"
#include "tests/benchmark/indexed_cell.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

const IndexedCell& IndexOf1M() {
  static const IndexedCell index(TableOf1M(), 2);
  return index;
}

// From robot images in memory, two threads.
void Build(benchmark::State& state) {
  const RobotImageTable& table = TableOf1M();
  Samples times;
  for (auto _ : state) {
    const uint64_t begin = Ticks();
    benchmark::DoNotOptimize(IndexedCell(table, 2));
    times.Add(static_cast<double>(Ticks() - begin) * TickLength());
    state.SetIterationTime(times.Quantile(0.5) * 1e-9);
  }
  state.counters["median_ns"] = times.Quantile(0.5);
}

void ReportSize(benchmark::State& state, const IndexedCell& index) {
  state.counters["bytes"] = static_cast<double>(index.bytes());
  state.counters["mask_bytes"] = static_cast<double>(index.mask_bytes());
}

// Of every `stride`th tile of 1 M configurations.
void Size(benchmark::State& state, double fill, uint64_t stride) {
  for (auto _ : state) {
    const SyntheticCell cell({.steps = StepsOfSize1M(), .fill = fill});
    ReportSize(state, IndexedCell(cell, stride));
  }
}

// The verdicts of all tiles, as the uncalibrated test gives them.
void SceneToMap1M(benchmark::State& state, SceneKind kind, Caches caches) {
  const IndexedCell& index = IndexOf1M();
  const RobotImageTable& table = TableOf1M();
  std::vector<TileVerdicts> map(index.tiles().size());
  MeasureScenes(state, ScenesOf1M(kind), caches, [&](const BenchmarkScene& scene) {
    const CollisionTest test(table, scene.images, Policy{});
    const SpaceTest space(test, index.trees());
    for (uint64_t tile = 0; tile < map.size(); ++tile) {
      map[tile] = space.CheckTile(tile, index.tiles()[tile]);
    }
  });
  const CollisionTest test(table, ScenesOf1M(kind).back().images, Policy{});
  uint64_t occupied = 0;
  for (uint64_t tile = 0; tile < map.size(); ++tile) {
    for (const uint64_t word : map[tile].occupied) {
      occupied += static_cast<uint64_t>(__builtin_popcountll(word));
    }
    if (tile % 97 == 0 && map[tile] != test.CheckTile(tile)) state.SkipWithError("a map is wrong");
  }
  state.counters["occupied_share"] =
      static_cast<double>(occupied) / static_cast<double>(table.grid().size());
}

// A cell whose masks are never in memory all at once; the last one that was asked for is kept.
struct LargeCell {
  explicit LargeCell(const CellSettings& the_settings)
      : settings(the_settings), cell(settings), index(cell) {}

  CellSettings settings;
  SyntheticCell cell;
  IndexedCell index;
};

const LargeCell& LargeCellOf(const CellSettings& settings) {
  static std::unique_ptr<const LargeCell> kept;
  if (kept == nullptr || !(kept->settings == settings)) {
    kept.reset();
    kept = std::make_unique<const LargeCell>(settings);
  }
  return *kept;
}

// The occupied configurations, from the index alone.
void SceneToPlanes(benchmark::State& state, const CellSettings& settings, SceneKind kind) {
  const auto& [unused, cell, index] = LargeCellOf(settings);
  const std::vector<BenchmarkScene> scenes = MakeScenes(cell, kind, kScenesPerKind);
  std::vector<PlaceSet> map(index.tiles().size());
  MeasureScenes(state, scenes, Caches::kWarm, [&](const BenchmarkScene& scene) {
    CollisionImages planes;
    for (const auto& image : scene.images) planes.emplace_back(image->obstacle());
    const PlaneVotes votes(index.trees(), planes, MinViews(Policy{}, kViews));
    for (uint64_t tile = 0; tile < map.size(); ++tile) {
      map[tile] = votes.Touching(index.tiles()[tile]);
    }
  });
  ReportSize(state, index);
  const auto configurations = static_cast<double>(cell.grid().size());
  state.counters["configurations"] = configurations;
  state.counters["ns_per_configuration"] = state.counters["median_ns"] / configurations;
}

void Register(SceneKind kind) {
  const std::string name = NameOf(kind);
  const auto manual = [](benchmark::internal::Benchmark* registered) {
    registered->UseManualTime()->Unit(benchmark::kMillisecond);
  };
  manual(benchmark::RegisterBenchmark(("scene_to_map_1m/" + name).c_str(), SceneToMap1M, kind,
                                      Caches::kWarm));
  manual(benchmark::RegisterBenchmark(("scene_to_map_1m/" + name + "_swept").c_str(), SceneToMap1M,
                                      kind, Caches::kSwept)
             ->Iterations(5));
}

const bool kRegistered = [] {
  benchmark::RegisterBenchmark("index_build_1m", Build)
      ->UseManualTime()
      ->Iterations(3)
      ->Unit(benchmark::kSecond);
  for (const auto& [name, fill] : {std::pair("2pct", 0.02), std::pair("10pct", 0.10)}) {
    benchmark::RegisterBenchmark((std::string("index_size/") + name).c_str(), Size, fill, 8)
        ->Iterations(1)
        ->Unit(benchmark::kSecond);
  }
  for (const SceneKind kind : kSceneKinds) Register(kind);
  const auto large = [](const std::string& name, const CellSettings& settings) {
    for (const SceneKind kind : kSceneKinds) {
      benchmark::RegisterBenchmark(("scene_to_planes_" + name + "/" + NameOf(kind)).c_str(),
                                   SceneToPlanes, settings, kind)
          ->UseManualTime()
          ->Unit(benchmark::kMillisecond);
    }
  };
  large("3k", {.steps = StepsOfSize3k()});
  large("1m", {.steps = StepsOfSize1M()});
  large("1m_10pct", {.steps = StepsOfSize1M(), .fill = 0.10});
  large("1m_128x96", {.steps = StepsOfSize1M(), .mask_size = {128, 96}});
  large("10m", {.steps = StepsOfSize10M()});
  large("10m_six_joints", {.steps = StepsOfSize10MWithSixJoints()});
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
