// Configurations in files, and as people read them.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "db/configuration_grid.h"
#include "tools/program/joint_values.h"

namespace silhouette {

// A configuration per line, values separated by commas or blanks; empty lines and what follows a #
// do not count. `file` "-": standard input. Errors name file and line.
absl::StatusOr<std::vector<Configuration>> ReadConfigurations(const std::string& file,
                                                              AngleUnit unit);

// The configurations under the key "waypoints" of a JSON file; at least one.
absl::StatusOr<std::vector<Configuration>> ReadWaypoints(const std::string& file);

// "0.5,-0.52": radians, with as many digits as people read.
std::string Spoken(const Configuration& configuration);

}  // namespace silhouette
