// SPDX-License-Identifier: Apache-2.0
// Scenes on purpose: an obstacle of the size of a hand where the robot hides it from all views.
#pragma once

#include <optional>

#include "tools/silhouette-experiments/cell/random_scene.h"

namespace silhouette::cell_experiment {

// `radius`: of the ball at least, metres; it is up to a quarter larger.
// The robot stands on a grid point, touches nothing, and is on the line of sight to every point of
// the one obstacle, a ball, in every view; some configurations of the grid touch it.
// Nothing if no such place was found, in a search that takes seconds.
std::optional<RandomScene> MakeHiddenScene(const SimulatedWorkplace& workplace, double radius,
                                           uint64_t seed, int number);

}  // namespace silhouette::cell_experiment
