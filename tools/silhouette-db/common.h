// SPDX-License-Identifier: Apache-2.0
// What several subcommands need: opening, choosing configurations, saying them.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/picture/chart.h"
#include "db/store/collision_index.h"
#include "db/store/schema.h"
#include "db/store/store.h"

namespace silhouette {

// A database opened for reading, in its present state.
struct OpenedDatabase {
  std::unique_ptr<Database> database;
  Snapshot snapshot;
};
// `variant`: of robot images.
absl::StatusOr<OpenedDatabase> OpenForReading(const std::string& path,
                                              const std::string& variant = schema::kDefaultVariant);

// Adds the database's folder, as the first argument or as --database.
void AddDatabaseArgument(CLI::App& command, std::string& database);

// Adds --variant, the variant that a subcommand speaks of.
void AddVariantOption(CLI::App& command, std::string& variant);

// The view of a name, by its place in the cell's views; the first one if it is empty.
// InvalidArgument, naming those that there are.
absl::StatusOr<int> ViewOf(const storage::v1::CellDescription& cell, const std::string& name);

// "axis_1 = 0.5, axis_2 = -1.25": joint values as people read them.
std::string JointText(const ConfigurationGrid& grid, ConfigurationNumber number);

// The same as an object of names and values.
nlohmann::json JointJson(const ConfigurationGrid& grid, ConfigurationNumber number);

// The time in UTC with its fraction; empty for the epoch, which stands for an unknown time.
std::string TimeText(absl::Time time);

// Joints with more than one value, as indices.
std::vector<int> MovingJoints(const ConfigurationGrid& grid);

// The axis of a chart along joint `j`.
ChartAxis AxisOf(const ConfigurationGrid& grid, int j);

// Configurations along one or two joints while the others stand still.
struct Slice {
  int across = 0;              // the joint that runs from left to right
  std::optional<int> upwards;  // the joint that runs from below to above; none: one row
  GridIndex index{};           // where the others stand
  std::string others;          // the same for people; empty if there are none
};

// `along`: names of one or two joints; empty: the first two that move. `fixed`: "joint=value" for
// others; those not named stand in the middle of their range. InvalidArgument for a name that is
// none, a joint named twice, or a value outside the grid.
absl::StatusOr<Slice> SliceOf(const ConfigurationGrid& grid, const std::vector<std::string>& along,
                              const std::vector<std::string>& fixed);

// "no robot images", "none", "fresh", "damaged" if a tile is, else "stale" if a tile is or has
// none.
std::string StateName(const CollisionIndexSummary& summary);

// One line: the state, and the mend if it is not fresh. `database`: its folder.
std::string StateText(const CollisionIndexSummary& summary, const std::string& database);

nlohmann::json StateJson(const CollisionIndexSummary& summary);

// The variants of a database, a line each, with their sizes; and as an array.
std::string VariantsText(const Database::Usage& usage, const ConfigurationGrid& grid);
nlohmann::json VariantsJson(const Database::Usage& usage);

// Cancelled, after Ctrl-C.
absl::Status Stopped(const std::string& how_to_go_on);

}  // namespace silhouette
