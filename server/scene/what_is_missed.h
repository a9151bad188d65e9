// SPDX-License-Identifier: Apache-2.0
// What a preset can miss, in the words of people who work in the cell.
#pragma once

#include <string>

#include "server/collision/policy.h"

namespace silhouette {

// A sentence or two on obstacles that verdicts under `policy` can miss because the robot hides
// them. `views`: of the database; `least_obstacle`: radius in metres, for the sound presets.
std::string WhatIsMissed(const Policy& policy, int views, double least_obstacle);

}  // namespace silhouette
