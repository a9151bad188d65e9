// SPDX-License-Identifier: Apache-2.0
// Joint values as people type them.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace silhouette {

// What a joint value without a unit is in.
enum class AngleUnit { kRadians, kDegrees };

// Whether the text is a finite decimal number, which `value` then gets.
bool IsDecimal(std::string_view text, double& value);

// "0.5", "-30deg", "0.5 rad" or "0.2m" in radians or metres. Throws std::invalid_argument with one
// sentence for everything else.
double ParseJointValue(std::string_view text, AngleUnit unit = AngleUnit::kRadians);

// "0.5,-30deg": values separated by commas. Throws as ParseJointValue does.
std::vector<double> ParseConfiguration(std::string_view text, AngleUnit unit = AngleUnit::kRadians);

// "joint_1=0.5": a name and a value. Throws as ParseJointValue does.
std::pair<std::string, double> ParseJoint(std::string_view text,
                                          AngleUnit unit = AngleUnit::kRadians);

// What to add where values in radians are outside a grid: a question if degrees seem to be meant,
// else nothing. `or_else`: what else mends it, as ", or give --degrees".
std::string DegreesHint(std::span<const double> radians, std::string_view or_else = "");

}  // namespace silhouette
