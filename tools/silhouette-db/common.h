// SPDX-License-Identifier: Apache-2.0
// What several subcommands need: opening a database, choosing configurations, describing them.
#pragma once

#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/picture/picture.h"
#include "db/store/collision_index.h"
#include "db/store/schema.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

// A database opened for reading, in its present state.
struct OpenedDatabase {
  std::unique_ptr<Database> database;
  Snapshot snapshot;
};
absl::StatusOr<OpenedDatabase> OpenForReading(const std::string& path,
                                              const std::string& variant = schema::kDefaultVariant);

// For writing. NotFound: there is none; FailedPrecondition: it is of another cell.
absl::StatusOr<std::unique_ptr<Database>> OpenOfCell(const std::string& path, const Cell& cell);

// What the robot images of each variant were drawn from, by the variant's name; captured ones are
// not among them.
absl::StatusOr<std::map<std::string, storage::v1::DrawnImages>> DrawnByVariant(
    const Database& database);

// The view of a name, by its place in the cell's views; the first one if it is empty.
// InvalidArgument, naming those that there are.
absl::StatusOr<int> ViewOf(const storage::v1::CellDescription& cell, const std::string& name);

// Whether a robot image shows no robot in any view: no obstacle could meet it, and it would always
// be free.
bool ShowsNoRobot(const RobotImage& image);

// "axis_1 = 0.5, axis_2 = -1.25": joint values as people read them.
std::string JointText(const ConfigurationGrid& grid, ConfigurationNumber number);

// The same as an object of names and values.
nlohmann::ordered_json JointJson(const ConfigurationGrid& grid, ConfigurationNumber number);

// The time in UTC with its fraction; empty for the epoch, which stands for an unknown time.
std::string TimeText(absl::Time time);

// "1.5 MiB".
std::string MiB(uint64_t bytes);

// Joints with more than one value, as indices.
std::vector<int> MovingJoints(const ConfigurationGrid& grid);

// A picture enlarged by the largest whole factor with which its longer side has at most `side`
// pixels.
Picture EnlargedTo(int side, const Picture& picture);

// One line: the state of a collision index, and the mend if it is not fresh. `database`: its
// folder.
std::string StateText(const CollisionIndexSummary& summary, const std::string& database);

// Its "state": "no robot images", "none", "fresh", "damaged" if a tile is, else "stale" if a tile
// is or has none.
nlohmann::ordered_json StateJson(const CollisionIndexSummary& summary);

// The variants of a database, a line each, with their sizes; and as an array.
std::string VariantsText(const Database::Usage& usage, const ConfigurationGrid& grid);
nlohmann::ordered_json VariantsJson(const Database::Usage& usage);

// Cancelled, after Ctrl-C.
absl::Status Stopped(const std::string& how_to_go_on);

}  // namespace silhouette
