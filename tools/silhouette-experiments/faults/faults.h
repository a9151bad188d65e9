// SPDX-License-Identifier: Apache-2.0
// What the checks of a view find, and what they find wrongly: the simulated cell is watched while
// people walk about and the robot moves, and now and then something is made wrong.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tools/silhouette-experiments/cell/simulated_workplace.h"

namespace silhouette::faults_experiment {

struct WatchSettings {
  double minutes = 10;   // of simulated time
  double interval = 1;   // seconds from one scene to the next
  int people = 3;        // who walk about
  int fault_every = 30;  // each fault is tried once in this many scenes
  int reference_images = 20;
  uint64_t seed = 1;
};

// A fault, or none, over all scenes in which it was tried.
struct FaultRow {
  std::string name;
  int tried = 0;
  int found = 0;                            // scenes with a defect
  std::map<std::string, int> reasons = {};  // of the defects; scenes with them
  std::vector<double> after = {};           // seconds of the robot's motion, where that finds it
};

struct WatchResult {
  int scenes = 0;
  double hours = 0;
  std::vector<std::string> alarms = {};  // false ones, when and what; scenes in a row are one
  FaultRow none = {};                    // nothing is wrong: what is found is a false alarm
  std::vector<FaultRow> faults = {};     // in turn
  // Median over the views' images, microseconds.
  double condition_time = 0;
  double life_time = 0;
  // The nearest that scenes without a fault came to the limits.
  double least_structure = 1;
  double greatest_shift = 0;
  double greatest_foreground = 0;
  double greatest_robot_missing = 0;
  double least_gain = 1;
  double greatest_gain = 1;
};

// `stop` is asked between scenes; the result is then of those done.
WatchResult Watch(const cell_experiment::SimulatedWorkplace& workplace,
                  const WatchSettings& settings, const std::function<bool()>& stop,
                  const std::function<void(int)>& done);

// Scenes without a fault.
int ScenesOf(const WatchSettings& settings);

}  // namespace silhouette::faults_experiment
