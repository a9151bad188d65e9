// The shared map: publishing it, and checks by looking into it as a client does.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "server/scene/configuration_space.h"
#include "server/service/shared_map_writer.h"
#include "silhouette/shared_space.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

// A server's side, with the map of a scene that does not grow old.
class Shared {
 public:
  Shared() {
    for (size_t i = 0; i < 2; ++i) {
      scenes_.push_back(ServedScenesOf1M(SceneKind::kPerson)[i]);
      spaces_.push_back(std::make_unique<const ConfigurationSpace>(scenes_[i], Policy{}));
      for (uint64_t tile = 0; tile < spaces_[i]->tiles(); ++tile) spaces_[i]->tile(tile);
    }
    const std::string file = "/dev/shm/silhouette-bench-" + std::to_string(getpid());
    auto writer = SharedMapWriter::Create({.file = file}, absl::InfiniteDuration(),
                                          scenes_[0].database, Policy{});
    if (!writer.ok()) throw std::runtime_error(std::string(writer.status().message()));
    writer_ = *std::move(writer);
    Publish(0);
    auto space = client::SharedSpace::Open(file);
    if (!space.ok()) throw std::runtime_error(std::string(space.status().message()));
    space_ = std::make_unique<const client::SharedSpace>(*space);
  }

  const client::SharedSpace& space() const { return *space_; }

  void Publish(size_t scene) {
    const absl::Status status =
        writer_->Publish(scenes_[scene], Policy{}, spaces_[scene].get(), Reason::kNone);
    if (!status.ok()) throw std::runtime_error(std::string(status.message()));
  }

  // Whether every 97th configuration is what the server's map of the scene says.
  bool IsRight(size_t scene) const {
    bool some_free = false;
    for (ConfigurationNumber number = 0; number < GridOf1M().number_limit(); number += 97) {
      const State state = spaces_[scene]->state(number);
      if (static_cast<int>(space_->StateAt(number)) != static_cast<int>(state)) return false;
      some_free = some_free || state == State::kFree;
    }
    return some_free;
  }

 private:
  std::vector<Served> scenes_;
  std::vector<std::unique_ptr<const ConfigurationSpace>> spaces_;
  std::unique_ptr<SharedMapWriter> writer_;
  std::unique_ptr<const client::SharedSpace> space_;
};

Shared& TheShared() {
  static Shared shared;
  return shared;
}

// As map_check and map_check/in_turn.
void SharedMapCheck(benchmark::State& state) {
  constexpr int kCount = 100'000;
  const client::SharedSpace& space = TheShared().space();
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount);
  MeasureShortCalls(state, kCount, [&](int i) {
    benchmark::DoNotOptimize(space.StateAt(numbers[static_cast<size_t>(i)]));
  });
  if (!TheShared().IsRight(0)) state.SkipWithError("the shared map is wrong");
}

void SharedMapCheckInTurn(benchmark::State& state) {
  constexpr int kCount = 20'000;
  constexpr int kParts = 16;
  const client::SharedSpace& space = TheShared().space();
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount * kParts);
  uint64_t zero = 0;
  benchmark::DoNotOptimize(zero);
  MeasureShortCalls(
      state, kCount,
      [&](int i) {
        const ConfigurationNumber* first = &numbers[static_cast<size_t>(i) * kParts];
        client::State answer = client::State::kUnknown;
        for (int part = 0; part < kParts; ++part) {
          answer = space.StateAt(first[part] + (static_cast<uint64_t>(answer) & zero));
        }
        benchmark::DoNotOptimize(answer);
      },
      kParts);
  if (!TheShared().IsRight(0)) state.SkipWithError("the shared map is wrong");
}

// By joint values, at grid points.
void CheckConfiguration(benchmark::State& state) {
  constexpr int kCount = 100'000;
  const client::SharedSpace& space = TheShared().space();
  std::vector<Configuration> configurations;
  for (const ConfigurationNumber number : RandomNumbers(GridOf1M(), kCount)) {
    configurations.push_back(GridOf1M().At(number));
  }
  MeasureShortCalls(state, kCount, [&](int i) {
    benchmark::DoNotOptimize(space.Check(configurations[static_cast<size_t>(i)]));
  });
}

void SharedMapBatch(benchmark::State& state) {
  constexpr int kCount = 1'000'000;
  const client::SharedSpace& space = TheShared().space();
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(GridOf1M(), kCount);
  const std::vector<uint32_t> packed(numbers.begin(), numbers.end());
  for (auto _ : state) benchmark::DoNotOptimize(space.CheckNumbers(packed));
  state.counters["per_second"] =
      benchmark::Counter(kCount, benchmark::Counter::kIsIterationInvariantRate);
}

// Two scenes in turns: each is compared with, and stored over, the one two updates before.
void Publish(benchmark::State& state) {
  Shared& shared = TheShared();
  MeasureCalls(state, 200, [&](int i) { shared.Publish(static_cast<size_t>(i / 2 % 2)); });
  if (!shared.IsRight(1)) state.SkipWithError("the shared map is wrong");
  shared.Publish(0);
}

const bool kSharedMapRegistered = [] {
  const auto add = [](const std::string& name, auto what) {
    return benchmark::RegisterBenchmark(name.c_str(), what)->UseManualTime();
  };
  add("shared_map_check", SharedMapCheck);
  add("shared_map_check/in_turn", SharedMapCheckInTurn);
  add("shared_map_check/configuration", CheckConfiguration);
  benchmark::RegisterBenchmark("shared_map_batch", SharedMapBatch)->Unit(benchmark::kMillisecond);
  add("shared_map_publish", Publish);
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
