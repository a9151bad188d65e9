// SPDX-License-Identifier: Apache-2.0
// Checks in process, from the masks themselves: the collision test without an index. The masks are
// in memory, or read from the database where they are needed.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/collision/collision_checker.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

enum class Masks { kInMemory, kInPlace };

CollisionChecker TestOf(SceneKind kind, Masks masks = Masks::kInMemory) {
  const CellOf1M& cell = TheCellOf1M();
  const auto& database = masks == Masks::kInMemory ? cell.database : cell.in_place;
  return CollisionChecker(database->robot_images(), ScenesOf1M(kind)[0].images, Policy{});
}

void MasksCheck(benchmark::State& state, SceneKind kind, Caches caches, Masks masks) {
  const int count = caches == Caches::kWarm ? 100'000 : 320;
  const CollisionChecker test = TestOf(kind, masks);
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), count);
  MeasureCalls(
      state, count,
      [&](int i) { benchmark::DoNotOptimize(test.Check(numbers[static_cast<size_t>(i)])); },
      caches);
}

void MasksBatch(benchmark::State& state, SceneKind kind) {
  constexpr int kCount = 1'000'000;
  const CollisionChecker test = TestOf(kind);
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount);
  for (auto _ : state) {
    for (const ConfigurationNumber number : numbers) {
      benchmark::DoNotOptimize(test.Check(number));
    }
  }
  ReportBatch(state, kCount);
}

void MasksEdge(benchmark::State& state, SceneKind kind, Masks masks) {
  constexpr int kEdges = 10'000;
  const CollisionChecker test = TestOf(kind, masks);
  const std::vector<ConfigurationNumber> numbers = RandomEdges(GridOf1M(), kEdges);
  MeasureCalls(state, kEdges, [&](int edge) {
    for (size_t i = 0; i < 32; ++i) {
      benchmark::DoNotOptimize(test.Check(numbers[static_cast<size_t>(edge) * 32 + i]));
    }
  });
}

Configuration Near(const ConfigurationGrid& grid, ConfigurationNumber number, double steps) {
  Configuration q = grid.At(number);
  for (size_t joint = 0; joint < q.size(); ++joint) {
    const GridJoint& of = grid.joints()[joint];
    q[joint] += steps * of.step() * (q[joint] + std::abs(steps) * of.step() > of.upper ? -1 : 1);
  }
  return q;
}

// In the middle between eight configurations, all of which are looked at.
void OffGrid(benchmark::State& state, SceneKind kind, Masks masks) {
  constexpr int kCount = 20'000;
  const CollisionChecker test = TestOf(kind, masks);
  std::vector<Configuration> configurations;
  for (const ConfigurationNumber number : RandomNumbers(GridOf1M(), kCount)) {
    configurations.push_back(Near(GridOf1M(), number, 0.5));
  }
  MeasureCalls(state, kCount, [&](int i) {
    benchmark::DoNotOptimize(test.Check(configurations[static_cast<size_t>(i)]));
  });
}

// A short way across the cells of the grid, up to where it is not free.
void Path(benchmark::State& state, SceneKind kind, Masks masks) {
  constexpr int kCount = 2'000;
  const CollisionChecker test = TestOf(kind, masks);
  std::vector<std::vector<Configuration>> paths;
  for (const ConfigurationNumber number : RandomNumbers(GridOf1M(), kCount)) {
    paths.push_back({Near(GridOf1M(), number, 0.3), Near(GridOf1M(), number, 3.6)});
  }
  MeasureCalls(state, kCount, [&](int i) {
    benchmark::DoNotOptimize(test.CheckPath(paths[static_cast<size_t>(i)]));
  });
}

const bool kMasksRegistered = [] {
  for (const auto& [name, masks] :
       {std::pair("", Masks::kInMemory), std::pair("_in_place", Masks::kInPlace)}) {
    const auto add = [name = std::string(name)](const char* what, auto function,
                                                auto... arguments) {
      return benchmark::RegisterBenchmark((what + name + "/person").c_str(), function,
                                          SceneKind::kPerson, arguments...)
          ->UseManualTime();
    };
    add("masks_check", MasksCheck, Caches::kWarm, masks);
    add("masks_edge_32", MasksEdge, masks);
    add("masks_off_grid", OffGrid, masks);
    add("masks_path", Path, masks);
  }
  return true;
}();

BENCHMARK_CAPTURE(MasksCheck, person_swept, SceneKind::kPerson, Caches::kSwept, Masks::kInMemory)
    ->Name("masks_check/person_swept")
    ->UseManualTime()
    ->Iterations(1);
BENCHMARK_CAPTURE(MasksBatch, person, SceneKind::kPerson)
    ->Name("masks_batch/person")
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace silhouette::benchmarks
