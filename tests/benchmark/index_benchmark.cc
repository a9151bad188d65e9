// SPDX-License-Identifier: Apache-2.0
// The collision index: building it, its size, and from a scene to the map of the whole
// configuration space.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>
#include <vector>

#include "server/collision/space_checker.h"
#include "tests/benchmark/indexed_cell.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

// As silhouette-db index does it: from the database on disk, in two threads. Once, when the
// database is made.
void Build(benchmark::State& state) {
  const TimedBuild& build = TheCellOf1M().index_build;
  for (auto _ : state) state.SetIterationTime(build.time * 1e-9);
  state.counters["median_ns"] = build.time;
  state.counters["bytes"] = static_cast<double>(build.report.bytes);
  state.counters["mask_bytes"] = static_cast<double>(build.report.mask_bytes);
  state.counters["database_bytes"] = static_cast<double>(TheCellOf1M().database_bytes);
  const TimedLoad& loaded = TheCellOf1M().loaded;
  state.counters["memory_bytes"] = static_cast<double>(loaded.memory_bytes);
  state.counters["load_ns"] = loaded.time;
  const TimedLoad& in_place = TheCellOf1M().loaded_in_place;
  state.counters["in_place_memory_bytes"] = static_cast<double>(in_place.memory_bytes);
  state.counters["in_place_load_ns"] = in_place.time;
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
void SceneToPlanes(benchmark::State& state, const CellSettings& settings, SceneKind kind,
                   Caches caches) {
  const LargeCell& large = LargeCellOf(settings);
  const auto& cell = large.cell;
  const auto& index = large.index;
  const std::vector<BenchmarkScene> scenes = MakeScenes(cell, kind, kScenesPerKind);
  std::vector<PlaceSet> map(index.tiles().size());
  MeasureScenes(state, scenes.size(), caches, [&](size_t i) {
    CollisionImages planes;
    for (const auto& image : scenes[i].images) planes.emplace_back(image->obstacle());
    const PlaneVotes votes(index.trees(), planes, MinViews(Policy{}, kViews));
    for (uint64_t tile = 0; tile < map.size(); ++tile) {
      map[tile] = votes.Touching(index.tiles()[tile]);
    }
  });
  ReportSize(state, index);
  state.counters["configurations"] = static_cast<double>(cell.grid().size());
}

const bool kIndexRegistered = [] {
  benchmark::RegisterBenchmark("index_build_1m", Build)
      ->UseManualTime()
      ->Iterations(1)
      ->Unit(benchmark::kSecond);
  for (const auto& [name, fill] : {std::pair("2pct", 0.02), std::pair("10pct", 0.10)}) {
    benchmark::RegisterBenchmark((std::string("index_size/") + name).c_str(), Size, fill, 8)
        ->Iterations(1)
        ->Unit(benchmark::kSecond);
  }
  const auto add = [](const std::string& name, const CellSettings& settings, SceneKind kind,
                      Caches caches) {
    return benchmark::RegisterBenchmark(("scene_to_planes_" + name).c_str(), SceneToPlanes,
                                        settings, kind, caches)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  const auto large = [&](const std::string& name, const CellSettings& settings) {
    for (const SceneKind kind : kSceneKinds) {
      add(name + "/" + NameOf(kind), settings, kind, Caches::kWarm);
    }
  };
  large("3k", {.steps = StepsOfSize3k()});
  large("1m", {.steps = StepsOfSize1M()});
  add("1m/person_swept", {.steps = StepsOfSize1M()}, SceneKind::kPerson, Caches::kSwept)
      ->Iterations(5);
  large("1m_10pct", {.steps = StepsOfSize1M(), .fill = 0.10});
  large("1m_128x96", {.steps = StepsOfSize1M(), .mask_size = {128, 96}});
  large("10m", {.steps = StepsOfSize10M()});
  large("10m_six_joints", {.steps = StepsOfSize10MWithSixJoints()});
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
