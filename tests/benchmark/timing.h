// SPDX-License-Identifier: Apache-2.0
// How benchmarks take times, and what they report of them.
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

namespace silhouette::benchmarks {

// The processor's time stamp, after all that was to be done before and before all that is to be
// done after; where there is none, nanoseconds of the running clock.
uint64_t Ticks();
// Nanoseconds per tick.
double TickLength();
// What Ticks() twice, with nothing between, seems to take: nanoseconds, median. Measured once.
double TimerCost();

// Durations in nanoseconds.
class Samples {
 public:
  void Add(double nanoseconds) { values_.push_back(nanoseconds); }
  bool empty() const { return values_.empty(); }
  // `q` 0 to 1; 0 if there are none.
  double Quantile(double q) const;

 private:
  std::vector<double> values_;
};

// Reads and writes twice what the largest cache holds, so that nothing else is left in any cache.
void SweepCaches();

enum class Caches { kWarm, kSwept };

// Times `call(i)` for i = 0 .. count - 1, each by itself, less the cost of the timer. One iteration
// of the benchmark is all calls. Counters: p50_ns, p99_ns, and timer_ns, what was taken off. With
// Caches::kSwept the caches are swept before every 16 calls.
void MeasureCalls(benchmark::State& state, int count, const std::function<void(int)>& call,
                  Caches caches = Caches::kWarm);

// As MeasureCalls, for calls that take nanoseconds: `Call` is inlined. Each call does `parts` equal
// parts; p50_ns and p99_ns are those of one part, on the average over its call: the time stamp of
// some processors goes on by 10 ns at a time.
template <typename Call>
void MeasureShortCalls(benchmark::State& state, int count, Call call, int parts = 1,
                       Caches caches = Caches::kWarm);

// Times `evaluate(i)` for scene i = 0 .. scenes - 1; one iteration of the benchmark is all scenes.
// Counters: median_ns and worst_ns over the scenes, each scene standing for the median of its
// times. With Caches::kSwept the caches are swept before each time.
void MeasureScenes(benchmark::State& state, size_t scenes, Caches caches,
                   const std::function<void(size_t)>& evaluate);

// Sets p50_ns, p99_ns and timer_ns.
void ReportCalls(benchmark::State& state, const Samples& samples);

// Sets per_second, of `count` checks per iteration.
void ReportBatch(benchmark::State& state, int count);

template <typename Call>
void MeasureShortCalls(benchmark::State& state, int count, Call call, int parts, Caches caches) {
  Samples samples;
  const double timer = TimerCost();
  for (auto _ : state) {
    double total = 0;
    for (int i = 0; i < count; ++i) {
      if (caches == Caches::kSwept && i % 16 == 0) SweepCaches();
      const uint64_t begin = Ticks();
      call(i);
      const uint64_t end = Ticks();
      const double time = std::max(0.0, static_cast<double>(end - begin) * TickLength() - timer);
      samples.Add(time / parts);
      total += time;
    }
    state.SetIterationTime(total * 1e-9);
  }
  ReportCalls(state, samples);
}

}  // namespace silhouette::benchmarks
