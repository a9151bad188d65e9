// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/timing.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace silhouette::benchmarks {
namespace {

using SteadyClock = std::chrono::steady_clock;

double SecondsSince(SteadyClock::time_point begin) {
  return std::chrono::duration<double>(SteadyClock::now() - begin).count();
}

// Times of one part of a benchmark, in nanoseconds.
double TimeOf(const std::function<void()>& work) {
  const auto begin = SteadyClock::now();
  work();
  return SecondsSince(begin) * 1e9;
}

}  // namespace

#if defined(__x86_64__)
uint64_t Ticks() {
  _mm_lfence();
  const uint64_t ticks = __rdtsc();
  _mm_lfence();
  return ticks;
}

double TickLength() {
  static const double length = [] {
    const auto begin = SteadyClock::now();
    const uint64_t ticks = Ticks();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const uint64_t passed = Ticks() - ticks;
    return SecondsSince(begin) * 1e9 / static_cast<double>(passed);
  }();
  return length;
}
#else
uint64_t Ticks() {
  return static_cast<uint64_t>(SteadyClock::now().time_since_epoch() / std::chrono::nanoseconds(1));
}

double TickLength() { return 1; }
#endif

double TimerCost() {
  static const double cost = [] {
    Samples samples;
    for (int i = 0; i < 100'000; ++i) {
      const uint64_t begin = Ticks();
      const uint64_t end = Ticks();
      samples.Add(static_cast<double>(end - begin) * TickLength());
    }
    return samples.Quantile(0.5);
  }();
  return cost;
}

double Samples::Quantile(double q) const {
  if (values_.empty()) return 0;
  std::vector<double> values = values_;
  const auto place =
      static_cast<std::ptrdiff_t>(std::lround(q * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<size_t>(place)];
}

void SweepCaches() {
  static std::vector<uint64_t> memory = [] {
    const long cache = sysconf(_SC_LEVEL3_CACHE_SIZE);
    const size_t bytes = 2 * (cache > 0 ? static_cast<size_t>(cache) : size_t{64} << 20);
    return std::vector<uint64_t>(bytes / sizeof(uint64_t), 1);
  }();
  for (size_t i = 0; i < memory.size(); i += 8) ++memory[i];
  benchmark::ClobberMemory();
}

void ReportCalls(benchmark::State& state, const Samples& samples) {
  state.counters["p50_ns"] = samples.Quantile(0.5);
  state.counters["p99_ns"] = samples.Quantile(0.99);
  state.counters["timer_ns"] = TimerCost();
}

void ReportBatch(benchmark::State& state, int count) {
  state.counters["per_second"] =
      benchmark::Counter(count, benchmark::Counter::kIsIterationInvariantRate);
}

void MeasureCalls(benchmark::State& state, int count, const std::function<void(int)>& call,
                  Caches caches) {
  MeasureShortCalls(
      state, count, [&](int i) { call(i); }, 1, caches);
}

void MeasureScenes(benchmark::State& state, size_t scenes, Caches caches,
                   const std::function<void(size_t)>& evaluate) {
  std::vector<Samples> times(scenes);
  for (auto _ : state) {
    double total = 0;
    for (size_t i = 0; i < scenes; ++i) {
      if (caches == Caches::kSwept) SweepCaches();
      const double time = TimeOf([&] { evaluate(i); });
      times[i].Add(time);
      total += time;
    }
    state.SetIterationTime(total * 1e-9);
  }
  Samples over_scenes;
  for (const Samples& scene : times) over_scenes.Add(scene.Quantile(0.5));
  state.counters["median_ns"] = over_scenes.Quantile(0.5);
  state.counters["worst_ns"] = over_scenes.Quantile(1);
}

}  // namespace silhouette::benchmarks
