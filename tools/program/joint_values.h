// SPDX-License-Identifier: Apache-2.0
// Joint values as people type them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/text/degrees_hint.h"

namespace silhouette {

// What a joint value without a unit is in.
enum class AngleUnit { kRadians, kDegrees };

// Whether the text is a finite decimal number, which `value` then gets.
bool IsDecimal(std::string_view text, double& value);

// Whether a unit stands behind a number.
bool StatesUnit(std::string_view text);

// "0.5", "-30deg", "0.5 rad" or "0.2m" in radians or metres. `unit`: where none is stated and the
// joint does not slide; `slides`: whether its values are metres, nothing if that is not known.
// Throws std::invalid_argument with one sentence for everything else, and where the unit stated
// is not one of the joint's.
double ParseJointValue(std::string_view text, AngleUnit unit = AngleUnit::kRadians,
                       std::optional<bool> slides = std::nullopt);

// "0.5,-30deg": values separated by commas. `slides`: of each joint. Throws as ParseJointValue
// does.
std::vector<double> ParseConfiguration(std::string_view text,
                                       std::span<const std::optional<bool>> slides = {});

// "joint_1=0.5": a name and a value. Throws as ParseJointValue does.
std::pair<std::string, double> ParseJoint(std::string_view text,
                                          AngleUnit unit = AngleUnit::kRadians,
                                          std::optional<bool> slides = std::nullopt);

}  // namespace silhouette
