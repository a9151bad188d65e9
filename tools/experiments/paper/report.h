// The measured rows as text, JSON and CSV.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "tools/experiments/paper/study.h"

namespace silhouette::paper {

// A number of configurations in percent of the configuration space.
double Percent(const Row& row, double configurations);

// One table per experiment, variant, rig and raster: a line per preset and threshold, a column per
// number of cameras.
std::string TableOf(std::span<const Row> rows);

// An array with one object per row.
nlohmann::ordered_json JsonOf(std::span<const Row> rows);

// The same with a line per row under a header.
std::string CsvOf(std::span<const Row> rows);

}  // namespace silhouette::paper
