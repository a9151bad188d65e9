// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/large_cells.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <random>

#include "absl/time/clock.h"
#include "tests/test_folder.h"

namespace silhouette::benchmarks {
namespace {

// Bytes of this process that are in memory and in no file.
uint64_t OwnMemory() {
  std::ifstream in("/proc/self/statm");
  uint64_t total = 0;
  uint64_t resident = 0;
  uint64_t shared = 0;
  in >> total >> resident >> shared;
  return (resident - shared) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

std::shared_ptr<const ServedDatabase> Load(const std::string& path, const LoadSettings& settings,
                                           TimedLoad& took) {
  malloc_trim(0);  // what is free and kept would be used
  const uint64_t memory = OwnMemory();
  const absl::Time begin = absl::Now();
  auto database = LoadDatabase(path, settings);
  took = {OwnMemory() - memory, absl::ToDoubleNanoseconds(absl::Now() - begin)};
  return database;
}

}  // namespace

CellOf1M::CellOf1M() : cell({.steps = StepsOfSize1M()}) {
  const std::string path = TestFolder() / "1m.lmdb";
  WriteDatabase(cell, path);
  index_build = BuildIndex(path);
  database_bytes = BytesInUse(path);
  in_place = Load(path, {.robot_image_memory = 0}, loaded_in_place);
  database = Load(path, {}, loaded);
}

const CellOf1M& TheCellOf1M() {
  static const CellOf1M cell;
  return cell;
}

const std::vector<BenchmarkScene>& ScenesOf1M(SceneKind kind) {
  static std::map<SceneKind, std::vector<BenchmarkScene>> scenes;
  std::vector<BenchmarkScene>& of_kind = scenes[kind];
  if (of_kind.empty()) of_kind = MakeScenes(TheCellOf1M().cell, kind, kScenesPerKind);
  return of_kind;
}

const std::vector<Served>& ServedScenesOf1M(SceneKind kind) {
  static std::map<SceneKind, std::vector<Served>> scenes;
  std::vector<Served>& of_kind = scenes[kind];
  if (of_kind.empty()) {
    for (const BenchmarkScene& scene : ScenesOf1M(kind)) {
      of_kind.push_back(ServedScene(TheCellOf1M().database, scene));
    }
  }
  return of_kind;
}

std::vector<ConfigurationNumber> RandomNumbers(const ConfigurationGrid& grid, int count) {
  std::mt19937_64 random(1);
  std::vector<ConfigurationNumber> numbers;
  while (numbers.size() < static_cast<size_t>(count)) {
    const ConfigurationNumber number = random() % grid.number_limit();
    if (grid.Contains(number)) numbers.push_back(number);
  }
  return numbers;
}

std::vector<ConfigurationNumber> RandomEdges(const ConfigurationGrid& grid, int count) {
  std::mt19937_64 random(2);
  std::vector<ConfigurationNumber> numbers;
  for (const ConfigurationNumber start : RandomNumbers(grid, count)) {
    GridIndex index = *grid.IndexOf(start);
    const int joint = static_cast<int>(random() % static_cast<uint64_t>(grid.dimensions()));
    const int last = grid.joints()[static_cast<size_t>(joint)].steps - 32;
    index[static_cast<size_t>(joint)] = std::min(index[static_cast<size_t>(joint)], last);
    for (int i = 0; i < 32; ++i) {
      numbers.push_back(grid.NumberOf(index));
      ++index[static_cast<size_t>(joint)];
    }
  }
  return numbers;
}

}  // namespace silhouette::benchmarks
