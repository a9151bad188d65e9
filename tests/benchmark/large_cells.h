// SPDX-License-Identifier: Apache-2.0
// What several benchmarks measure on; made when it is first asked for and kept.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tests/benchmark/scenes.h"
#include "tests/benchmark/synthetic_cell.h"
#include "tests/benchmark/synthetic_database.h"

namespace silhouette::benchmarks {

inline constexpr int kScenesPerKind = 8;

// What loading a database took.
struct TimedLoad {
  uint64_t memory_bytes = 0;  // that it takes afterwards, without what is mapped
  double time = 0;            // nanoseconds
};

// 1 M configurations of three joints, four views of 64 x 64 pixels, 2 % of them robot: the database
// with its collision index, on disk and loaded, with 2 GB of robot images in memory.
struct CellOf1M {
  CellOf1M();

  SyntheticCell cell;
  TimedBuild index_build;
  uint64_t database_bytes = 0;  // in use on disk, the index included
  TimedLoad loaded;
  std::shared_ptr<const ServedDatabase> database;
  // The same, with robot images that are read from the database where they are needed.
  TimedLoad loaded_in_place;
  std::shared_ptr<const ServedDatabase> in_place;
};
const CellOf1M& TheCellOf1M();
inline const RobotImageTable& TableOf1M() { return TheCellOf1M().database->robot_images(); }
inline const ConfigurationGrid& GridOf1M() { return TheCellOf1M().cell.grid(); }

// Scenes in it.
const std::vector<BenchmarkScene>& ScenesOf1M(SceneKind kind);
// The same as the server has them.
const std::vector<Served>& ServedScenesOf1M(SceneKind kind);

// `count` random configurations of a grid, always the same.
std::vector<ConfigurationNumber> RandomNumbers(const ConfigurationGrid& grid, int count);
// `count` times 32 configurations on a line along a random joint, one after another.
std::vector<ConfigurationNumber> RandomEdges(const ConfigurationGrid& grid, int count);

}  // namespace silhouette::benchmarks
