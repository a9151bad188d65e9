// SPDX-License-Identifier: Apache-2.0
// Databases of synthesised cells on disk, as a capture leaves them, and what is served of them. All
// functions throw std::runtime_error where the disk does not allow it.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "db/store/collision_index.h"
#include "server/scene/scene_store.h"
#include "server/scene/served_database.h"
#include "tests/benchmark/scenes.h"
#include "tests/benchmark/synthetic_cell.h"

namespace silhouette::benchmarks {

// What the views of the cells are called, 0 to 3: view_1 to view_4.
std::string ViewName(int view);

// What every view of the cells sees without robot and obstacles: 640 x 480, grey levels as doubles.
cv::Mat EmptyCellPicture();

// Makes a database with all robot images of the cell, and reference images, in the new folder
// `path`; about 5 us per configuration.
void WriteDatabase(const SyntheticCell& cell, const std::string& path);

// Builds its collision index in two threads.
struct TimedBuild {
  IndexBuildReport report;
  double time = 0;  // nanoseconds
};
TimedBuild BuildIndex(const std::string& path);

// Bytes of the database in use on disk.
uint64_t BytesInUse(const std::string& path);

std::shared_ptr<const ServedDatabase> LoadDatabase(const std::string& path,
                                                   const LoadSettings& settings = {});

// A scene of the cell as a server has it, made of the masks that the views would give.
Served ServedScene(const std::shared_ptr<const ServedDatabase>& database,
                   const BenchmarkScene& scene);

}  // namespace silhouette::benchmarks
