// Configurations in files, and as people read them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "db/mask/configuration_grid.h"
#include "tools/program/joint_values.h"

namespace silhouette {

// A configuration per line, values separated by commas or blanks; empty lines and what follows a #
// do not count. `file` "-": standard input. Errors name file and line.
absl::StatusOr<std::vector<Configuration>> ReadConfigurations(const std::string& file,
                                                              AngleUnit unit);

// One such line; nothing if there is nothing on it. Throws std::invalid_argument with one sentence.
std::optional<Configuration> ParseLine(absl::string_view line, AngleUnit unit);

// The configurations under the key "waypoints" of a JSON file; at least one.
absl::StatusOr<std::vector<Configuration>> ReadWaypoints(const std::string& file);

// "0.5,-0.52": radians, with as many digits as people read.
std::string Spoken(const Configuration& configuration);

}  // namespace silhouette
