// SPDX-License-Identifier: Apache-2.0
// The measured rows as text and JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette::paper {

// One table per experiment, variant, rig and raster: a line per method and threshold, a column per
// number of cameras, and times where they are known; at the end the conclusion.
std::string TextOf(std::span<const Row> rows);

// What the numbers say of §2's claim, as sentences; empty if there are not both kinds of methods
// with all cameras on random scenes.
std::string ConclusionOf(std::span<const Row> rows);

// An array with one object per row; `preset` is the method. `voxels`, `prepare_ms`, `space_ms`,
// `check_us` where they are known.
nlohmann::ordered_json JsonOf(std::span<const Row> rows);

}  // namespace silhouette::paper
