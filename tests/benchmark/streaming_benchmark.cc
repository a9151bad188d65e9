// SPDX-License-Identifier: Apache-2.0
// Baselines: what memory allows. Every configuration is tested by its masks, all of which come from
// memory: the plain way to the map of the whole configuration space.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "server/collision/collision_checker.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

constexpr size_t kWords = 64;  // of a mask of 64 x 64 pixels

// The thread sanitizer cannot start a program that chooses among clones.
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
#define SILHOUETTE_FOR_EVERY_PROCESSOR __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SILHOUETTE_FOR_EVERY_PROCESSOR
#endif

// Bit i: whether mask i of the 64 masks at `masks` has a pixel in common with the plane.
SILHOUETTE_FOR_EVERY_PROCESSOR
uint64_t Touching(const uint64_t* __restrict masks, const uint64_t* __restrict plane) {
  uint64_t touching = 0;
  for (size_t i = 0; i < 64; ++i) {
    const uint64_t* mask = masks + i * kWords;
    uint64_t common[8] = {};
    for (size_t word = 0; word < kWords; word += 8) {
      for (size_t j = 0; j < 8; ++j) common[j] |= mask[word + j] & plane[word + j];
    }
    uint64_t any = 0;
    for (size_t j = 0; j < 8; ++j) any |= common[j];
    touching |= uint64_t{any != 0} << i;
  }
  return touching;
}

SILHOUETTE_FOR_EVERY_PROCESSOR
uint64_t StreamingUnionOf(const uint64_t* __restrict words, size_t count) {
  uint64_t bits[32] = {};
  for (size_t i = 0; i + 32 <= count; i += 32) {
    for (size_t j = 0; j < 32; ++j) bits[j] |= words[i + j];
  }
  uint64_t all = 0;
  for (const uint64_t bit : bits) all |= bit;
  return all;
}

// The masks of a view, one after another; every place of the grid has one.
const uint64_t* MasksOf(const RobotImageTable& table, int view) {
  return table.image(view, 0).data();
}

// The occupied configurations: at least three of four views show an obstacle.
void StreamAllMasks(const RobotImageTable& table, const ObstacleImages& images,
                    std::vector<uint64_t>& occupied) {
  const size_t blocks = table.grid().size() / 64;
  occupied.resize(blocks);
  std::array<const uint64_t*, kViews> masks;
  std::array<const uint64_t*, kViews> planes;
  for (int view = 0; view < kViews; ++view) {
    masks[static_cast<size_t>(view)] = MasksOf(table, view);
    planes[static_cast<size_t>(view)] =
        images[static_cast<size_t>(view)]->obstacle().words().data();
  }
  for (size_t block = 0; block < blocks; ++block) {
    std::array<uint64_t, kViews> shown;
    for (size_t view = 0; view < kViews; ++view) {
      shown[view] = Touching(masks[view] + block * 64 * kWords, planes[view]);
    }
    occupied[block] = (shown[0] & shown[1] & (shown[2] | shown[3])) |
                      (shown[2] & shown[3] & (shown[0] | shown[1]));
  }
}

// Whether the map is what the collision test says of every 97th tile.
bool StreamingIsRight(const RobotImageTable& table, const ObstacleImages& images,
                      const std::vector<uint64_t>& occupied) {
  const CollisionChecker test(table, images, Policy{});
  for (uint64_t tile = 0; tile < table.grid().tiles(); tile += 97) {
    const TileVerdicts verdicts = test.CheckTile(tile);
    if (!std::equal(verdicts.occupied.begin(), verdicts.occupied.end(),
                    occupied.begin() + static_cast<std::ptrdiff_t>(tile * kTileSize / 64))) {
      return false;
    }
  }
  return true;
}

void StreamingAllMasks(benchmark::State& state, SceneKind kind) {
  const RobotImageTable& table = TableOf1M();
  if (table.grid().size() != table.grid().number_limit()) {
    state.SkipWithError("the grid has absent places");
    return;
  }
  std::vector<uint64_t> occupied;
  const std::vector<BenchmarkScene>& scenes = ScenesOf1M(kind);
  MeasureScenes(state, scenes.size(), Caches::kWarm,
                [&](size_t i) { StreamAllMasks(table, scenes[i].images, occupied); });
  if (!StreamingIsRight(table, scenes.back().images, occupied)) {
    state.SkipWithError("the map is wrong");
  }
  state.counters["gigabytes"] =
      static_cast<double>(kViews * table.grid().size() * kWords * sizeof(uint64_t)) * 1e-9;
}

// Nothing but reading the same memory.
void MemoryRead(benchmark::State& state) {
  const RobotImageTable& table = TableOf1M();
  const size_t words = table.grid().size() * kWords;
  Samples samples;
  for (auto _ : state) {
    const uint64_t begin = Ticks();
    for (int view = 0; view < kViews; ++view) {
      benchmark::DoNotOptimize(StreamingUnionOf(MasksOf(table, view), words));
    }
    const double time = static_cast<double>(Ticks() - begin) * TickLength();
    samples.Add(time);
    state.SetIterationTime(time * 1e-9);
  }
  state.counters["median_ns"] = samples.Quantile(0.5);
  state.counters["gigabytes_per_second"] =
      static_cast<double>(kViews * words * sizeof(uint64_t)) / samples.Quantile(0.5);
}

BENCHMARK_CAPTURE(StreamingAllMasks, person, SceneKind::kPerson)
    ->Name("streaming_all_masks/person")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(StreamingAllMasks, hand, SceneKind::kHand)
    ->Name("streaming_all_masks/hand")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(StreamingAllMasks, clutter, SceneKind::kClutter)
    ->Name("streaming_all_masks/clutter")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(MemoryRead)->Name("memory_read")->UseManualTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace silhouette::benchmarks
