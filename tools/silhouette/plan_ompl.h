// SPDX-License-Identifier: Apache-2.0
// Planning with OMPL's planners.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "silhouette/client.h"
#include "tools/silhouette/commands.h"

namespace silhouette {

// The waypoints of a path from `start` to `goal`, both free; none if none was found in five
// seconds. `planner`: "rrtconnect" or "lbkpiece". Aborted if the user stops it.
absl::StatusOr<std::vector<Configuration>> SearchByOmpl(const Session& session,
                                                        const Client& client,
                                                        const std::string& planner,
                                                        const Configuration& start,
                                                        const Configuration& goal);

}  // namespace silhouette
