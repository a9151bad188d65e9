// SPDX-License-Identifier: Apache-2.0
// The measured rows as text, JSON and CSV.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "tools/silhouette-experiments/paper/reconstruction.h"

namespace silhouette::paper {

// One table per experiment, variant, rig and raster: a line per preset and threshold, a column per
// number of cameras.
std::string TableOf(std::span<const Row> rows);

// An array with one object per row.
nlohmann::ordered_json JsonOf(std::span<const Row> rows);

// One table per experiment, variant and rig, and the conclusion.
std::string TableOf(std::span<const MethodRow> rows);

// What the numbers say of §2's claim, as sentences; empty if there are not both kinds of methods
// with all cameras on random scenes.
std::string ConclusionOf(std::span<const MethodRow> rows);

// An array with the keys of the other experiments' rows, where `preset` is the method,
// and `voxels`, `prepare_ms`, `space_ms`, `check_us` where they are known.
nlohmann::ordered_json JsonOf(std::span<const MethodRow> rows);

// An array of objects with a line per object under a header of all their keys; empty where an
// object has not the key, or null.
std::string CsvOf(const nlohmann::ordered_json& rows);

}  // namespace silhouette::paper
