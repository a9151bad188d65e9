// SPDX-License-Identifier: Apache-2.0
// One trial: a scene of the simulated cell through the whole real path - camera images, scene,
// verdicts - and the verdicts against exact contact.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/devices/devices.h"
#include "capture/sim/contact.h"
#include "server/collision/collision_checker.h"
#include "server/collision/policy.h"
#include "server/scene/scene.h"
#include "server/scene/served_database.h"
#include "tools/silhouette-experiments/cell/scenes.h"
#include "tools/silhouette-experiments/cell/simulated_workplace.h"

namespace silhouette::cell_experiment {

// Where test configurations are.
enum Where : size_t { kOnGrid = 0, kOffGrid = 1 };
inline constexpr size_t kWheres = 2;

// Counts of test configurations.
struct Tally {
  uint64_t tested = 0;
  uint64_t occupied = 0;    // in truth
  uint64_t additional = 0;  // not reported free, and free in truth
  uint64_t missing = 0;     // reported free, and occupied in truth
  uint64_t flagged = 0;     // of the missing: reported as hidden_possible

  void Add(const Tally& other);
};

// A configuration that at least one policy reports free and that is occupied.
struct MissedConfiguration {
  Configuration configuration;
  Where where = kOnGrid;
  std::vector<size_t> policies;  // which
};

// What the cameras and the server made of a scene.
struct ViewedScene {
  RandomScene truth;
  std::vector<CameraImage> images;  // by view
  Scene scene;
};

struct TrialResult {
  // Why no verdict can be made on the scene; then nothing was tested.
  Reason blocked = Reason::kNone;
  std::vector<std::array<Tally, kWheres>> tallies;  // by policy
  std::vector<MissedConfiguration> missed;          // on the grid first
};

// What trials share.
struct TrialSetting {
  const SimulatedWorkplace& workplace;
  const ServedDatabase& database;
  std::vector<Policy> policies;
  // Test configurations off the grid; on the grid all are tested.
  int off_grid_tests = 0;
  uint64_t seed = 1;
};

// Puts the scene into the simulated cell, takes its images and makes the scene of them as the
// server does. `number` decides the noise.
absl::StatusOr<ViewedScene> View(const TrialSetting& setting, RandomScene scene, int number);

// One per policy of the setting. Refer to the setting and to `viewed`.
std::vector<std::unique_ptr<CollisionChecker>> CheckersOf(const TrialSetting& setting,
                                                          const ViewedScene& viewed);

// The configurations of the grid that have a robot image.
std::vector<Configuration> PresentConfigurations(const ServedDatabase& database);

// Uses both cores where there are two.
TrialResult Judge(const TrialSetting& setting, const ViewedScene& viewed, int number);

// InvalidArgument if one of `min_views` is not 1 to `views`.
absl::Status CheckMinViews(const std::vector<int>& min_views, int views);

// The named presets with the thresholds that they can have: all views, and as many as
// `uncalibrated` asks by the cell's policy; or those of `min_views`, which CheckMinViews passed.
// The sound presets ask all views. `max_occluded_views` is the cell's. Without names: all presets
// that the database can serve. FailedPrecondition if a named preset cannot be served.
absl::StatusOr<std::vector<Policy>> PoliciesFor(const std::vector<std::string>& presets,
                                                const std::vector<int>& min_views,
                                                const Policy& of_cell,
                                                const ServedDatabase& database);

}  // namespace silhouette::cell_experiment
