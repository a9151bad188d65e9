// What several benchmarks measure on; made when it is first asked for and kept.
#pragma once

#include <string>
#include <vector>

#include "server/collision/robot_image_table.h"
#include "tests/benchmark/scenes.h"
#include "tests/benchmark/synthetic_cell.h"

namespace silhouette::benchmarks {

inline constexpr int kScenesPerKind = 8;

// 1 M configurations of three joints, four views of 64 x 64 pixels, 2 % of them robot.
const SyntheticCell& CellOf1M();
// Its robot images: 2 GB.
const RobotImageTable& TableOf1M();
// Scenes in it.
const std::vector<BenchmarkScene>& ScenesOf1M(SceneKind kind);

// `count` random configurations of a grid, always the same.
std::vector<ConfigurationNumber> RandomNumbers(const ConfigurationGrid& grid, int count);
// `count` times 32 configurations on a line along a random joint, one after another.
std::vector<ConfigurationNumber> RandomEdges(const ConfigurationGrid& grid, int count);

// A folder that goes away with the program.
const std::string& TemporaryFolder();

}  // namespace silhouette::benchmarks
