// SPDX-License-Identifier: Apache-2.0
// What was counted, as text, JSON and charts.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tools/silhouette-experiments/people/counts.h"

namespace silhouette::people_experiment {

// The work of a method as a multiple of another's, over the episodes that both have.
struct WorkRatio {
  double ratio = 0;
  // Of the ratio: what chance of episodes does to it, to first order. Nothing of one episode.
  std::optional<double> standard_error;
};

struct MethodFigures {
  std::string name;
  Counts counts;
  // Nothing where the other has no episode or no work.
  std::optional<WorkRatio> to_curtain = std::nullopt;
  std::optional<WorkRatio> to_oracle = std::nullopt;
};

// In the order of `methods`.
std::vector<MethodFigures> FiguresOf(std::span<const EpisodeResult> results,
                                     std::span<const std::string> methods);

std::string TextOf(std::span<const MethodFigures> figures);
nlohmann::ordered_json JsonOf(std::span<const MethodFigures> figures);

// Writes work.png, cycles per hour by the share of time with people, and distances.png.
absl::Status WriteCharts(std::span<const EpisodeResult> results,
                         std::span<const MethodFigures> figures, const std::string& folder);

}  // namespace silhouette::people_experiment
