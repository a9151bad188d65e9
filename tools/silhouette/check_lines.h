// silhouette check --stream: configurations from standard input, answered one by one as they come.
#pragma once

#include "absl/status/statusor.h"
#include "silhouette/policy.h"
#include "tools/program/joint_values.h"
#include "tools/program/program.h"
#include "tools/silhouette/options.h"

namespace silhouette {

// One line of output for each line with a configuration, in their order. kDone if all are free;
// ends with Ctrl-C, or with the first line that is no configuration.
absl::StatusOr<ExitCode> CheckLines(const Session& session, AngleUnit unit,
                                    const client::Policy& policy, client::Clearance clearance);

}  // namespace silhouette
