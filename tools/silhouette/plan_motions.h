// SPDX-License-Identifier: Apache-2.0
// silhouette plan by checks of motions, without a grid.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "silhouette/client.h"
#include "silhouette/v1/database_service.pb.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {

// Why there is no path: its start, or its goal, is not free.
std::string BlockedEnd(const std::string& end, const client::Verdict& verdict,
                       const client::Basis& basis);
// The same: the one that was found is not free.
std::string BlockedPath(const client::PathCheck& check);

// A path as `path --file` reads it; no waypoints unless `check`, of all of it, is free.
Json PathFileOf(std::span<const GridJoint> joints, const std::string& outcome,
                const std::vector<Configuration>& waypoints,
                const std::optional<client::PathCheck>& check);

// Plans, writes the path into the file `out` (empty: none) and prints. Exit code as that of `plan`.
// `planner`: "rrtconnect" or "lbkpiece", of OMPL, on what is known in the client; "trees": the
// server checks every motion.
absl::StatusOr<ExitCode> PlanByMotions(const Session& session, const Client& client,
                                       const v1::GetDatabaseResponse& database,
                                       const std::string& planner, const Configuration& start,
                                       const Configuration& goal, const std::string& out);

}  // namespace silhouette
