// The measured rows as text, JSON and CSV.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette::paper {

// A number of configurations in percent of the configuration space.
double Percent(const Row& row, double configurations);

// One table per experiment, variant, rig and raster: a line per preset and threshold, a column per
// number of cameras.
std::string TableOf(std::span<const Row> rows);

// An array with one object per row.
nlohmann::ordered_json JsonOf(std::span<const Row> rows);

// Adds "<name>_percent", "<name>_min_percent", ... "<name>_count", ... to a row's object.
void AddSpread(nlohmann::ordered_json& object, const std::string& name, const Spread& spread,
               int64_t configurations);

// An array of objects with a line per object under a header of all their keys; empty where an
// object has not the key, or null.
std::string CsvOf(const nlohmann::ordered_json& rows);

}  // namespace silhouette::paper
