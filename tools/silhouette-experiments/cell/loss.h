// What a calibration that was found costs, against the true one: the same scenes, images and test
// configurations, judged with both.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "tools/silhouette-experiments/cell/report.h"

namespace silhouette::cell_experiment {

// One policy on an experiment's test configurations of one kind.
struct Comparison {
  Row truth;
  Row found;

  // By how many percent of the configurations there are more with the found calibration; below 0:
  // fewer.
  double AdditionalLoss() const;
  double MissingLoss() const;
};

// In the order of `truth`; rows that only one side has are left out.
std::vector<Comparison> Compare(std::span<const Row> truth, std::span<const Row> found);

std::string LossTableOf(std::span<const Comparison> comparisons);
std::string LossCsvOf(std::span<const Comparison> comparisons);

// As JsonOf(rows); rows that are compared have `found` and `loss`, too.
nlohmann::ordered_json JsonOf(std::span<const Row> rows, std::span<const Comparison> comparisons);

}  // namespace silhouette::cell_experiment
