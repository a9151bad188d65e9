// Obstacles where the robot hides them from all views: who finds them, and what else is blocked.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/collision/policy.h"
#include "tools/silhouette-experiments/hidden/hidden_cell.h"

namespace silhouette::hidden_experiment {

// A ball that no camera sees: every pixel of every view that shows any of it shows the robot. The
// robot does not touch it where it stands, and does at some configuration of the grid.
struct HiddenBall {
  Configuration robot;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0;
  // Per configuration of the grid, by number, whether the robot touches the ball.
  std::vector<bool> touches;
};

Obstacle ObstacleOf(const HiddenBall& ball);

// Nothing if none was found in a search of seconds. Different for every seed.
std::optional<HiddenBall> FindHiddenBall(const HiddenCell& cell, double radius, uint64_t seed);

// Verdicts against the truth, over the configurations of the grid.
struct Tally {
  int64_t touching = 0;  // really occupied
  int64_t found = 0;     // of these, not free
  int64_t clear = 0;     // really free
  int64_t kept = 0;      // of these, free

  Tally& operator+=(const Tally& other);
};

Tally Judge(const HiddenCell& cell, const Served& served, Preset preset,
            const std::vector<bool>& touches);

}  // namespace silhouette::hidden_experiment
