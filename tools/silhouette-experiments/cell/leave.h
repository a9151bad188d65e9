// SPDX-License-Identifier: Apache-2.0
// Whether the robot may leave: a person near it, and the steps that it may take.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/silhouette-experiments/cell/trial.h"

namespace silhouette::cell_experiment {

// A person, a trunk on the floor, 5 to 30 cm from the robot, which stands on a grid point; three
// ranges of distance in turn by `number`. Some configuration of the grid touches the person.
// Nothing if no such place was found.
struct LeaveScene {
  RandomScene scene;
  double distance = 0;  // metres
};
std::optional<LeaveScene> MakeLeaveScene(const SimulatedWorkplace& workplace, uint64_t seed,
                                         int number);

// One policy on persons at distances of one range.
struct LeaveRow {
  Policy policy;
  double nearest = 0;  // metres
  double farthest = 0;
  int scenes = 0;
  int stays = 0;  // scenes in which the robot's own place is free
  // Scenes in which no step to a neighbouring grid point, diagonal ones included, is free, though
  // in truth one is.
  int locked = 0;
  // Steps that in truth touch nothing, and those of them that are free; steps that touch the
  // person, and those of them that are called free.
  int steps = 0;
  int free_steps = 0;
  int touching_steps = 0;
  int wrong_steps = 0;
  Tally tally{};  // on the grid
};

struct LeaveResult {
  std::vector<LeaveRow> rows;
  int found = 0;     // scenes
  int unusable = 0;  // those of them that no verdict can be made on; they are in no row
};

// Called with the scenes done. Returning false stops.
using LeaveProgress = std::function<bool(int done)>;

// Scenes that are not found are left out. Cancelled: `progress` stopped it.
absl::StatusOr<LeaveResult> RunLeave(const TrialSetting& setting, int scenes,
                                     const LeaveProgress& progress);

std::string TextOf(std::span<const LeaveRow> rows);
nlohmann::ordered_json JsonOf(std::span<const LeaveRow> rows);

}  // namespace silhouette::cell_experiment
