// SPDX-License-Identifier: Apache-2.0
// A robot that follows a path with an acceleration limit. Pure: no scene, no people.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "db/mask/configuration_grid.h"

namespace silhouette::people_experiment {

// How far the robot's fastest point moves between two configurations, on a straight line in joint
// space, if it is as fast all along as where it is fastest: metres.
using Movement = std::function<double(std::span<const double> from, std::span<const double> to)>;

// Places on a path are counted by movement: metres, m/s, m/s^2.
class PathFollower {
 public:
  PathFollower(Configuration start, Movement movement, double acceleration);

  const Configuration& at() const { return at_; }
  double speed() const { return speed_; }
  bool stands() const { return speed_ == 0; }
  // Until it stands, if it brakes now.
  double StoppingDistance() const { return speed_ * speed_ / (2 * acceleration_); }
  double MovementOf(std::span<const double> from, std::span<const double> to) const {
    return movement_(from, to);
  }
  // Of the path.
  double left() const { return length_ - place_; }

  // From now on along these waypoints, of which the first is where the robot is. Throws
  // std::logic_error if it moves.
  void Follow(std::vector<Configuration> waypoints);

  // Where the path goes from here on, for `ahead` metres: the first is at(). At its end: at()
  // alone.
  std::vector<Configuration> Ahead(double ahead) const;

  // Goes on for `seconds`: as fast as `allowed`, the acceleration and the end of the path permit.
  void Advance(double seconds, double allowed);

 private:
  Configuration Place(double place) const;

  Movement movement_;
  double acceleration_;
  std::vector<Configuration> waypoints_;
  std::vector<double> places_;  // by waypoint
  double length_ = 0;
  double place_ = 0;
  double speed_ = 0;
  Configuration at_;
};

}  // namespace silhouette::people_experiment
