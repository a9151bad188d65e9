// SPDX-License-Identifier: Apache-2.0
// The verdict on a path, and how it is found.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/drawing/motion_check.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/stop.h"
#include "server/collision/verdict.h"

namespace silhouette {

// The verdict on a path.
struct PathVerdict {
  // Free if all of the path is; hidden_possible() if it is for any place. Else the verdict at
  // `configuration`, a place of the first part of the path that is not free.
  Verdict verdict;
  // Where that is: waypoint number and fraction of the way to the next one. Only if not free.
  int segment = 0;
  double fraction = 0;
  Configuration configuration;
  // Places tested, up to there.
  int64_t checked = 0;
  // Free, and drawn: 0, or what MotionCheck::sampled_step is of a motion that is not proven.
  double sampled_step = 0;
  // It was given up (PathSettings::stop); the verdict is unknown then.
  bool stopped = false;
};

// A place of a path that was tested.
struct TestedPlace {
  std::span<const double> configuration;
  // Waypoint number and fraction of the way to the next one.
  int segment = 0;
  double fraction = 0;
  Verdict verdict;
  // By how much the drawn robot was grown: the verdict holds for a part of the path.
  Growth growth = {};
  // The place is one of those by which a part of the path is sampled, in between nothing is known.
  bool sampled = false;
};

struct PathSettings {
  // Of a drawn robot, metres: parts of the path on which no point moves farther are sampled where
  // they are not proven. Under the sound presets they are unknown then (kMotionNotProven).
  double resolution = kMotionResolution;
  // If it is one, called with every place that is tested, in their order.
  std::function<void(const TestedPlace&)> tested = nullptr;
  // Asked before each test.
  Stop stop = nullptr;
};

}  // namespace silhouette
