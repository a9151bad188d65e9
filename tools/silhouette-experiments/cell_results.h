// What `silhouette-experiments cell` measured, into files.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tools/silhouette-experiments/cell/study.h"

namespace silhouette::cell_experiment {

// Scenes of one kind under one calibration, and what came of them.
struct Experiment {
  std::string name;
  const TrialSetting* setting = nullptr;
  SceneSource source;
  std::vector<SceneRecord> records;
};

// Writes `text` to `folder`/`name`; nothing without a folder.
absl::Status WriteResult(const std::string& folder, const std::string& name,
                         const std::string& text);

// Scenes, missing configurations and at most `pictures` pictures of each experiment, by its name.
absl::Status WriteExperiments(std::span<const Experiment> experiments, const std::string& folder,
                              size_t pictures);

}  // namespace silhouette::cell_experiment
