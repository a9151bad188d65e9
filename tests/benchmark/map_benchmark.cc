// SPDX-License-Identifier: Apache-2.0
// The configuration-space map: from a scene to it, and checks in process by looking into it.
#include <benchmark/benchmark.h>

#include <bit>
#include <memory>
#include <string>
#include <vector>

#include "server/scene/configuration_space.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

// A map that is worked out.
std::unique_ptr<const ConfigurationSpace> MapOf(const Served& served) {
  auto map = std::make_unique<const ConfigurationSpace>(served, Policy{});
  for (uint64_t tile = 0; tile < map->tiles(); ++tile) map->tile(tile);
  return map;
}

// The map of the scene that the checks by the masks are measured in, too.
const ConfigurationSpace& PersonMap() {
  static const std::unique_ptr<const ConfigurationSpace> map =
      MapOf(ServedScenesOf1M(SceneKind::kPerson)[0]);
  return *map;
}

// Whether every 97th tile is what the collision test says of the masks.
bool MapIsRight(const ConfigurationSpace& map, const Served& served) {
  const CollisionChecker test(TableOf1M(), served.scene->obstacle_images, Policy{});
  for (uint64_t tile = 0; tile < map.tiles(); tile += 97) {
    if (map.tile(tile) != test.CheckTile(tile)) return false;
  }
  return true;
}

double OccupiedShare(const ConfigurationSpace& map) {
  double occupied = 0;
  for (uint64_t tile = 0; tile < map.tiles(); ++tile) {
    for (const uint64_t word : map.tile(tile).occupied) occupied += std::popcount(word);
  }
  return occupied / static_cast<double>(GridOf1M().size());
}

void SceneToMap(benchmark::State& state, SceneKind kind, Caches caches) {
  const std::vector<Served>& scenes = ServedScenesOf1M(kind);
  MeasureScenes(state, scenes.size(), caches,
                [&](size_t i) { benchmark::DoNotOptimize(MapOf(scenes[i])); });
  const std::unique_ptr<const ConfigurationSpace> map = MapOf(scenes.back());
  if (!MapIsRight(*map, scenes.back())) state.SkipWithError("a map is wrong");
  state.counters["occupied_share"] = OccupiedShare(*map);
}

// Each check by itself.
void MapCheck(benchmark::State& state, Caches caches) {
  const int count = caches == Caches::kWarm ? 100'000 : 320;
  const ConfigurationSpace& map = PersonMap();
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), count);
  const auto check = [&](int i) {
    benchmark::DoNotOptimize(map.state(numbers[static_cast<size_t>(i)]));
  };
  MeasureShortCalls(state, count, check, 1, caches);
}

// 16 checks, each of which waits for the answer of the one before.
void MapCheckInTurn(benchmark::State& state) {
  constexpr int kCount = 20'000;
  constexpr int kParts = 16;
  const ConfigurationSpace& map = PersonMap();
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount * kParts);
  uint64_t zero = 0;
  benchmark::DoNotOptimize(zero);
  MeasureShortCalls(
      state, kCount,
      [&](int i) {
        const ConfigurationNumber* first = &numbers[static_cast<size_t>(i) * kParts];
        State answer = State::kUnknown;
        for (int part = 0; part < kParts; ++part) {
          answer = map.state(first[part] + (static_cast<uint64_t>(answer) & zero));
        }
        benchmark::DoNotOptimize(answer);
      },
      kParts);
}

void MapBatch(benchmark::State& state) {
  constexpr int kCount = 1'000'000;
  const ConfigurationSpace& map = PersonMap();
  const std::vector<ConfigurationNumber> wide = RandomNumbers(GridOf1M(), kCount);
  const std::vector<uint32_t> numbers(wide.begin(), wide.end());
  std::vector<uint64_t> free((kCount + 63) / 64);
  std::vector<uint64_t> occupied(free.size());
  for (auto _ : state) {
    map.States(numbers, free, occupied);
    benchmark::ClobberMemory();
  }
  ReportBatch(state, kCount);
}

// One verdict of all, as a planner asks it of an edge.
void MapEdge(benchmark::State& state) {
  constexpr int kEdges = 20'000;
  const ConfigurationSpace& map = PersonMap();
  const std::vector<ConfigurationNumber> numbers = RandomEdges(GridOf1M(), kEdges);
  MeasureShortCalls(state, kEdges, [&](int edge) {
    const ConfigurationNumber* first = &numbers[static_cast<size_t>(edge) * 32];
    bool free = true;
    for (int i = 0; i < 32; ++i) free = (map.state(first[i]) == State::kFree) && free;
    benchmark::DoNotOptimize(free);
  });
}

const bool kMapRegistered = [] {
  const auto add = [](const std::string& name, auto... what) {
    return benchmark::RegisterBenchmark(name.c_str(), what...)->UseManualTime();
  };
  for (const SceneKind kind : kSceneKinds) {
    const std::string name = "scene_to_map_1m/" + NameOf(kind);
    add(name, SceneToMap, kind, Caches::kWarm)->Unit(benchmark::kMillisecond);
    add(name + "_swept", SceneToMap, kind, Caches::kSwept)
        ->Unit(benchmark::kMillisecond)
        ->Iterations(5);
  }
  add("map_check", MapCheck, Caches::kWarm);
  add("map_check/in_turn", MapCheckInTurn);
  add("map_check/swept", MapCheck, Caches::kSwept)->Iterations(1);
  add("map_edge_32", MapEdge);
  benchmark::RegisterBenchmark("map_batch", MapBatch)->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
