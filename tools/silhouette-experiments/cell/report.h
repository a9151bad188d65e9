// SPDX-License-Identifier: Apache-2.0
// What was measured, as text, JSON and CSV.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "tools/silhouette-experiments/cell/explanation.h"

namespace silhouette::cell_experiment {

// One line of the table: a policy on an experiment's test configurations of one kind.
struct Row {
  uint64_t seed = 0;
  std::string experiment;
  Policy policy;
  int min_views = 0;
  Where where = kOnGrid;
  int scenes = 0;   // tested; without those that no verdict can be made on
  int refused = 0;  // scenes that no verdict can be made on
  Tally tally;
  std::array<uint64_t, kCauses> causes{};  // of the missing configurations

  // Of the configurations tested.
  double AdditionalPercent() const;
  double MissingPercent() const;
  // Of those that are occupied in truth.
  double MissedCollisionsPercent() const;
};

// In the order of the policies, on the grid first.
std::vector<Row> RowsOf(const std::string& experiment, const TrialSetting& setting,
                        const std::vector<SceneRecord>& records);

std::string TextOf(std::span<const Row> rows);
nlohmann::ordered_json JsonOf(std::span<const Row> rows);
std::string CsvOf(std::span<const Row> rows);

// One line per scene and policy.
std::string ScenesCsvOf(const TrialSetting& setting, const std::vector<SceneRecord>& records);

// One line per missing configuration and policy, with its cause and sentence. `pictures`: names of
// files by record and missing configuration, empty where there is none.
std::string MissingCsvOf(const TrialSetting& setting, const std::vector<SceneRecord>& records,
                         const std::vector<std::vector<std::string>>& pictures);

// "on_grid" or "off_grid".
std::string NameOf(Where where);

// One policy on an experiment's test configurations of one kind, judged with the true calibration
// and captured robot images, and in another way: the same scenes and images.
struct Comparison {
  Row usual;
  Row other;

  // By how many percent of the configurations there are more in the other way; below 0: fewer.
  double AdditionalLoss() const { return other.AdditionalPercent() - usual.AdditionalPercent(); }
  double MissingLoss() const { return other.MissingPercent() - usual.MissingPercent(); }
  int64_t MissingLossCount() const {
    return static_cast<int64_t>(other.tally.missing) - static_cast<int64_t>(usual.tally.missing);
  }
};

// The other way, as results name it, and what the two are, in words.
struct OtherWay {
  std::string name;
  std::string heading;
};

// In the order of `usual`; rows that only one side has are left out.
std::vector<Comparison> Compare(std::span<const Row> usual, std::span<const Row> other);

std::string LossTextOf(std::span<const Comparison> comparisons, const OtherWay& way);
std::string LossCsvOf(std::span<const Comparison> comparisons, const OtherWay& way);

// As JsonOf(rows); rows that are compared have the name of the other way and `loss`, too.
nlohmann::ordered_json JsonOf(std::span<const Row> rows, std::span<const Comparison> comparisons,
                              const OtherWay& way);

}  // namespace silhouette::cell_experiment
