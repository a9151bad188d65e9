// SPDX-License-Identifier: Apache-2.0
// How long PublishScene takes while other clients, in a process of their own (publish_load.cc), ask
// the server all they can.
#include <benchmark/benchmark.h>
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/running_server.h"
#include "tests/benchmark/synthetic_database.h"
#include "tests/benchmark/timing.h"
#include "tests/test_folder.h"

namespace silhouette::benchmarks {
namespace {

constexpr int kClients = 24;
constexpr int kScenes = 400;
constexpr std::chrono::milliseconds kBetweenScenes{5};

const SyntheticCell& PublishedCell() {
  static const SyntheticCell cell({.steps = StepsOfSize3k()});
  return cell;
}

RunningServer& PublishedTo() {
  static RunningServer server("unix:" + TestFolder().string() + "/publish", PublishedCell(), [] {
    const std::string path = TestFolder() / "published.lmdb";
    WriteDatabase(PublishedCell(), path);
    BuildIndex(path);
    return LoadDatabase(path);
  }());
  return server;
}

// Clients that ask, from the constructor's end until this ends. Throws std::runtime_error unless
// each has had an answer.
class Askers {
 public:
  Askers(const std::string& address, std::string kind) {
    std::array<int, 2> answers;
    benchmarks::Require(pipe2(answers.data(), O_CLOEXEC) == 0, "no pipe");
    std::string program =
        std::filesystem::read_symlink("/proc/self/exe").parent_path() / "silhouette-bench-load";
    std::string to = address;
    std::string clients = std::to_string(kClients);
    std::array<char*, 5> words = {program.data(), to.data(), clients.data(), kind.data(), nullptr};
    posix_spawn_file_actions_t output;
    posix_spawn_file_actions_init(&output);
    posix_spawn_file_actions_adddup2(&output, answers[1], STDOUT_FILENO);
    const int failed =
        posix_spawn(&process_, program.c_str(), &output, nullptr, words.data(), environ);
    posix_spawn_file_actions_destroy(&output);
    close(answers[1]);
    int answered = 0;
    std::array<char, kClients> bytes;
    while (failed == 0 && answered < kClients) {
      const ssize_t more = read(answers[0], bytes.data(), bytes.size());
      if (more <= 0) break;
      answered += static_cast<int>(more);
    }
    close(answers[0]);
    benchmarks::Require(answered >= kClients, program + " did not ask; build it");
  }
  ~Askers() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  Askers(const Askers&) = delete;
  Askers& operator=(const Askers&) = delete;

 private:
  pid_t process_ = 0;
};

// `kind`: as publish_load.cc has it; empty: no load.
void PublishUnder(benchmark::State& state, const std::string& kind) {
  RunningServer& server = PublishedTo();
  const std::vector<BenchmarkScene> scenes = MakeScenes(PublishedCell(), SceneKind::kPerson, 8);
  [[maybe_unused]] const std::optional<Askers> askers =
      kind.empty() ? std::nullopt : std::make_optional<Askers>(server.address(), kind);
  Samples samples;
  for (auto _ : state) {
    std::chrono::duration<double> total{0};
    for (size_t i = 0; i < kScenes; ++i) {
      std::this_thread::sleep_for(kBetweenScenes);
      const v1::PublishSceneRequest request =
          RunningServer::RequestOf(PublishedCell(), scenes[i % scenes.size()]);
      const auto begin = std::chrono::steady_clock::now();
      server.Publish(request);
      const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
      samples.Add(time.count() * 1e9);
      total += time;
    }
    state.SetIterationTime(total.count());
  }
  ReportCalls(state, samples);
}

const bool kPublishRegistered = [] {
  for (const std::string kind : {"", "paths", "checks", "explain", "watches"}) {
    const std::string name = "publish/" + (kind.empty() ? "idle" : kind);
    benchmark::RegisterBenchmark(name.c_str(), PublishUnder, kind)
        ->Iterations(1)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
