// SPDX-License-Identifier: Apache-2.0
// The figures of the study as data: tools/plot draws them.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "tools/silhouette-experiments/paper/settings.h"

namespace silhouette::paper {

// An object with
//   floor_plan  Figure 1: size, obstacles and pinhole cameras, as in the settings;
//   setups      Figure 6, per arm and rig: half_width, spheres of the parked `robot` and of the
//               `obstacles` of Figure 7's scene, and per camera its axes and its obstacle image, a
//               string per row: "o" obstacle, "u" unknown, "e" error, "." background;
//   verdicts    per arm and rig one random scene with all cameras and touched pixels: `steps` per
//               joint, `current` steps of the robot, and a string with "1" per occupied
//               configuration, a * steps + b: `occupied` really, `reported` by each method. The
//               scene is the first in which the preset paper misses a lot, if there is one.
nlohmann::ordered_json FiguresOf(const Settings& settings, std::span<const Variant> variants,
                                 std::span<const std::string> rigs);

}  // namespace silhouette::paper
