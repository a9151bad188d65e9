// SPDX-License-Identifier: Apache-2.0
// The study: many scenes, one trial each, every missing configuration explained.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/silhouette-experiments/cell/explanation.h"
#include "tools/silhouette-experiments/cell/trial.h"

namespace silhouette::cell_experiment {

struct ExplainedConfiguration {
  MissedConfiguration missed;
  std::vector<Explanation> explanations;  // one per policy of `missed`
};

struct SceneRecord {
  int number = 0;
  bool robot_on_grid = false;
  Reason blocked = Reason::kNone;                   // then nothing was tested
  std::vector<std::array<Tally, kWheres>> tallies;  // by policy
  std::vector<ExplainedConfiguration> missing;
};

// Makes scene `number` of an experiment.
using SceneSource = std::function<RandomScene(int number)>;

// The trial of one scene.
absl::StatusOr<SceneRecord> RunScene(const TrialSetting& setting, Explainer& explainer,
                                     const SceneSource& source, int number);

// A missing configuration of a record, by their indices.
struct Chosen {
  size_t record = 0;
  size_t missing = 0;
};

// At most `count` missing configurations for pictures: two of every cause, then from the scenes
// with the most of them in turn.
std::vector<Chosen> ChooseForPictures(const std::vector<SceneRecord>& records, size_t count);

}  // namespace silhouette::cell_experiment
