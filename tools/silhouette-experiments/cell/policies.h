// Which policies the experiment tests.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/collision/policy.h"
#include "server/scene/served_database.h"

namespace silhouette::cell_experiment {

// The presets asked for, by name - if there are none, all that the database can serve -, with the
// thresholds that they can have: n - 1 and n of n views. FailedPrecondition if one that is asked
// for cannot be served.
absl::StatusOr<std::vector<Policy>> PoliciesFor(const std::vector<std::string>& presets,
                                                const ServedDatabase& database);

}  // namespace silhouette::cell_experiment
