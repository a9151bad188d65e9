// Configurations as people type them.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "db/configuration_grid.h"

namespace silhouette {

// What a joint value without a unit is in.
enum class AngleUnit { kRadians, kDegrees };

// "0.5", "-30deg", "0.5rad" or "0.2m" in radians or metres. Throws std::invalid_argument with one
// sentence for everything else.
double ParseJointValue(std::string_view text, AngleUnit unit);

// "0.5,-30deg": values separated by commas. Throws as ParseJointValue does.
Configuration ParseConfiguration(std::string_view text, AngleUnit unit);

// "joint_1=0.5": a name and a value. Throws as ParseJointValue does.
std::pair<std::string, double> ParseJoint(std::string_view text, AngleUnit unit);

// A configuration per line, values separated by commas or blanks; empty lines and what follows a #
// do not count. `file` "-": standard input. Errors name file and line.
absl::StatusOr<std::vector<Configuration>> ReadConfigurations(const std::string& file,
                                                              AngleUnit unit);

// The configurations under the key "waypoints" of a JSON file; at least one.
absl::StatusOr<std::vector<Configuration>> ReadWaypoints(const std::string& file);

// "0.5,-0.52": radians, with as many digits as people read.
std::string Spoken(const Configuration& configuration);

}  // namespace silhouette
