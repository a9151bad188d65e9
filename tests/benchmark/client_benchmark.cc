// SPDX-License-Identifier: Apache-2.0
// The map in the client: LocalSpace, subscribed to a server in this process.
#include <benchmark/benchmark.h>

#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "silhouette/client.h"
#include "silhouette/local_space.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/running_server.h"
#include "tests/benchmark/timing.h"
#include "tests/test_folder.h"

namespace silhouette::benchmarks {
namespace {

// Of 1 M configurations, with a scene in it that does not grow old.
const LocalSpace& Space() {
  static const RunningServer server("unix:" + TestFolder().string() + "/local", TheCellOf1M().cell,
                                    TheCellOf1M().database);
  static const LocalSpace space(Client::Connect(server.address()).value(),
                                {.max_age = absl::Hours(1)});
  for (uint64_t seen = 0; space.unknown_reason().has_value();) {
    const auto snapshot = space.WaitForUpdate(seen, absl::Minutes(1));
    Require(snapshot->number() != seen, "no update of the configuration space comes");
    seen = snapshot->number();
  }
  return space;
}

// 16 checks by `map`, each of which waits for the answer of the one before.
template <typename Map>
void ClientInTurn(benchmark::State& state, const Map& map) {
  constexpr int kCount = 20'000;
  constexpr int kParts = 16;
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount * kParts);
  uint64_t zero = 0;
  benchmark::DoNotOptimize(zero);
  bool decided = true;
  MeasureShortCalls(
      state, kCount,
      [&](int i) {
        const ConfigurationNumber* first = &numbers[static_cast<size_t>(i) * kParts];
        client::State answer = client::State::kUnknown;
        for (int part = 0; part < kParts; ++part) {
          answer = map.StateAt(first[part] + (static_cast<uint64_t>(answer) & zero));
        }
        decided = answer != client::State::kUnknown && decided;
      },
      kParts);
  if (!decided) state.SkipWithError("a check was not decided");
}

// Each check by itself.
void Single(benchmark::State& state) {
  constexpr int kCount = 100'000;
  const LocalSpace& space = Space();
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount);
  MeasureShortCalls(state, kCount, [&](int i) {
    benchmark::DoNotOptimize(space.StateAt(numbers[static_cast<size_t>(i)]));
  });
}

// Free motions of the map through four grid cells.
void LocalMotion(benchmark::State& state) {
  constexpr int kCount = 20'000;
  const auto snapshot = Space().Snapshot();
  std::mt19937_64 random(1);
  std::vector<std::pair<Configuration, Configuration>> motions;
  const auto joints = GridOf1M().joints();
  while (motions.size() < kCount) {
    Configuration from;
    Configuration to;
    for (size_t j = 0; j < joints.size(); ++j) {
      const int at = std::uniform_int_distribution(0, joints[j].steps - 4)(random);
      // Three crossings: four cells.
      const double steps = j < 3 ? 1 : 0.2;
      from.push_back(joints[j].lower +
                     (at + 0.3 + 0.1 * static_cast<double>(j)) * joints[j].step());
      to.push_back(from.back() + steps * joints[j].step());
    }
    if (snapshot->CheckMotion(from, to).free()) motions.emplace_back(from, to);
  }
  MeasureShortCalls(state, kCount, [&](int i) {
    const auto& [from, to] = motions[static_cast<size_t>(i)];
    benchmark::DoNotOptimize(snapshot->CheckMotion(from, to));
  });
}

void ClientBatch(benchmark::State& state) {
  constexpr int kCount = 1'000'000;
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount);
  const std::vector<uint32_t> packed(numbers.begin(), numbers.end());
  const LocalSpace& space = Space();
  for (auto _ : state) benchmark::DoNotOptimize(space.CheckNumbers(packed));
  ReportBatch(state, kCount);
}

const bool kClientRegistered = [] {
  benchmark::RegisterBenchmark("local_client/in_turn", [](benchmark::State& state) {
    ClientInTurn(state, Space());
  })->UseManualTime();
  benchmark::RegisterBenchmark("local_client/snapshot", [](benchmark::State& state) {
    ClientInTurn(state, *Space().Snapshot());
  })->UseManualTime();
  benchmark::RegisterBenchmark("local_client/single", Single)->UseManualTime();
  benchmark::RegisterBenchmark("local_client/motion", LocalMotion)->UseManualTime();
  benchmark::RegisterBenchmark("local_client/batch", ClientBatch)->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
