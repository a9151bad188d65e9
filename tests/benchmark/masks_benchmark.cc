// Checks in process, from the masks themselves: the collision test without an index.
#include <benchmark/benchmark.h>

#include <memory>
#include <vector>

#include "server/collision/collision_test.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

CollisionTest TestOf(SceneKind kind) {
  return CollisionTest(TableOf1M(), ScenesOf1M(kind)[0].images, Policy{});
}

void Check(benchmark::State& state, SceneKind kind, Caches caches) {
  const int count = caches == Caches::kWarm ? 100'000 : 320;
  const CollisionTest test = TestOf(kind);
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), count);
  MeasureCalls(
      state, count,
      [&](int i) { benchmark::DoNotOptimize(test.Check(numbers[static_cast<size_t>(i)])); },
      caches);
}

void Batch(benchmark::State& state, SceneKind kind) {
  constexpr int kCount = 1'000'000;
  const CollisionTest test = TestOf(kind);
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount);
  for (auto _ : state) {
    for (const ConfigurationNumber number : numbers) {
      benchmark::DoNotOptimize(test.Check(number));
    }
  }
  state.counters["per_second"] =
      benchmark::Counter(kCount, benchmark::Counter::kIsIterationInvariantRate);
}

void Edge(benchmark::State& state, SceneKind kind) {
  constexpr int kEdges = 10'000;
  const CollisionTest test = TestOf(kind);
  const std::vector<ConfigurationNumber> numbers = RandomEdges(GridOf1M(), kEdges);
  MeasureCalls(state, kEdges, [&](int edge) {
    for (size_t i = 0; i < 32; ++i) {
      benchmark::DoNotOptimize(test.Check(numbers[static_cast<size_t>(edge) * 32 + i]));
    }
  });
}

BENCHMARK_CAPTURE(Check, person, SceneKind::kPerson, Caches::kWarm)
    ->Name("masks_check/person")
    ->UseManualTime();
BENCHMARK_CAPTURE(Check, person_swept, SceneKind::kPerson, Caches::kSwept)
    ->Name("masks_check/person_swept")
    ->UseManualTime()
    ->Iterations(1);
BENCHMARK_CAPTURE(Batch, person, SceneKind::kPerson)
    ->Name("masks_batch/person")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Edge, person, SceneKind::kPerson)->Name("masks_edge_32/person")->UseManualTime();

}  // namespace
}  // namespace silhouette::benchmarks
