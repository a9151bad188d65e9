// SPDX-License-Identifier: Apache-2.0
// Speed and separation: how fast the robot may follow a path so that it stands before it touches
// somebody (ISO/TS 15066, 5.5.4). An aid for planning and for studying a cell, no certified
// function.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "silhouette/running_clock.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// A speed at which the robot may be driven.
struct SpeedLevel {
  std::string name;
  double speed = 0;              // of its fastest point, m/s
  double stopping_time = 0;      // from the command to stop until it stands, s
  double stopping_distance = 0;  // that its fastest point moves meanwhile, metres
};

// What is not set is as the server's cell file states it; docs/cell.yaml explains the values.
struct SeparationPolicy {
  std::optional<double> human_speed = std::nullopt;       // m/s
  std::optional<double> near_human_speed = std::nullopt;  // m/s
  // From a reply until the robot begins to stop, s: what lies between the server and the robot.
  std::optional<double> reaction_time = std::nullopt;
  std::optional<double> intrusion = std::nullopt;    // metres
  std::optional<double> uncertainty = std::nullopt;  // metres
  // From slow to fast.
  std::vector<SpeedLevel> levels = {};
  // Only the beginning of the path counts, as far as the robot moves up to this on it, metres, and
  // then until it stands from the level's speed.
  std::optional<double> horizon = std::nullopt;
};

// How fast the robot may follow a path, at whose end it stops.
struct Separation {
  // Number of the fastest level that keeps its distance, from 1. 0: the robot must stop. Ask
  // LevelNow().
  int level = 0;
  std::string level_name = {};  // empty: the robot must stop
  // At least so far are the parts of the robot that the path moves, anywhere on it, and all that is
  // seen or could be there unseen; metres, in space. With a horizon as far as the level looks.
  double distance = 0;
  // Where that is: waypoint number and fraction of the way to the next one.
  int segment = 0;
  double fraction = 0;
  // Nowhere on the path is the robot nearer to people than at its beginning, but for 2 cm. False
  // where they are within the diameter of the least obstacle there: what is thinner and hidden by
  // the robot may be nearer than `distance`. Ask LeadsAwayNow().
  bool leads_away = false;
  // The distances that the levels keep from the path, from slow to fast, metres. From a single
  // waypoint they keep what the robot moves until it stands, too.
  std::vector<double> protective_distances = {};
  // How old the newest image may become before a newer reply comes; counted as reaction.
  absl::Duration image_age = absl::InfiniteDuration();
  // Why nothing is known of distances; then the level is 0.
  Reason unknown_reason = Reason::kUnspecified;
  RunningClock::time_point valid_until = {};

  // Whether it lets the robot move while it is valid.
  bool lets_move() const { return level > 0 || leads_away; }
  // Whether the reply is not too old to be gone by; `level`, and `leads_away`, and 0 and false when
  // it is.
  bool ValidNow() const { return RunningClock::now() < valid_until; }
  int LevelNow() const { return ValidNow() ? level : 0; }
  bool LeadsAwayNow() const { return ValidNow() && leads_away; }
};

}  // namespace silhouette::client
