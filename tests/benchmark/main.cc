// SPDX-License-Identifier: Apache-2.0
// silhouette-bench: Google Benchmark's options, and --help and --version as all programs have them.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <span>
#include <string_view>

namespace {

void PrintHelp() {
  std::puts(
      "Measures how long things take: silhouette-bench [OPTIONS]\n\n"
      "Options:\n"
      "  --help                             Print this help message and exit\n"
      "  --version                          Display program version information and exit\n"
      "  --benchmark_list_tests             List the benchmarks and exit\n"
      "  --benchmark_filter=REGEX           Only benchmarks whose names match\n"
      "  --benchmark_format=console|json|csv\n"
      "                                     Output for people or for scripts\n"
      "  --benchmark_out=FILE               Also write the results into a file\n"
      "  --benchmark_out_format=json|console|csv\n"
      "  --benchmark_repetitions=N          Measure N times\n"
      "  --benchmark_min_time=SECONDS       Least time for each\n\n"
      "Example:\n"
      "  silhouette-bench --benchmark_filter='^scene_to_map' --benchmark_format=json");
}

}  // namespace

int main(int argc, char** argv) {
  const std::span<char*> words(argv, static_cast<size_t>(argc));
  const auto is_version = [](std::string_view word) { return word == "--version"; };
  if (std::ranges::any_of(words, is_version)) {
    std::puts("silhouette-bench " SILHOUETTE_VERSION);
    return 0;
  }
  benchmark::Initialize(&argc, argv, PrintHelp);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
