// SPDX-License-Identifier: Apache-2.0
// silhouette plan by checks of motions, without a grid.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "silhouette/client.h"
#include "silhouette/v1/database_service.pb.h"
#include "tools/silhouette/commands.h"

namespace silhouette {

// Plans, writes the path into the file `out` (empty: none) and prints. Exit code as that of `plan`.
// `planner`: "rrtconnect" or "lbkpiece", of OMPL, on what is known in the client; "trees": the
// server checks every motion.
absl::StatusOr<ExitCode> PlanByMotions(const Session& session, const Client& client,
                                       const v1::GetDatabaseResponse& database,
                                       const std::string& planner, const Configuration& start,
                                       const Configuration& goal, const std::string& out);

}  // namespace silhouette
