// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/motion.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace silhouette::people_experiment {
namespace {

// The robot has arrived: metres, m/s.
constexpr double kArrived = 1e-4;

}  // namespace

PathFollower::PathFollower(Configuration start, Movement movement, double acceleration)
    : movement_(std::move(movement)), acceleration_(acceleration), at_(std::move(start)) {
  Follow({at_});
}

void PathFollower::Follow(std::vector<Configuration> waypoints) {
  if (!stands()) throw std::logic_error("a robot that moves cannot take another path");
  waypoints_ = std::move(waypoints);
  places_ = {0};
  for (size_t i = 1; i < waypoints_.size(); ++i) {
    places_.push_back(places_.back() + movement_(waypoints_[i - 1], waypoints_[i]));
  }
  length_ = places_.back();
  place_ = 0;
}

Configuration PathFollower::Place(double place) const {
  const auto after = std::upper_bound(places_.begin(), places_.end(), place);
  if (after == places_.end()) return waypoints_.back();
  const auto to = static_cast<size_t>(after - places_.begin());
  const double share = (place - places_[to - 1]) / (places_[to] - places_[to - 1]);
  Configuration q = waypoints_[to - 1];
  for (size_t j = 0; j < q.size(); ++j) q[j] += share * (waypoints_[to][j] - q[j]);
  return q;
}

std::vector<Configuration> PathFollower::Ahead(double ahead) const {
  std::vector<Configuration> piece = {at_};
  const double end = std::min(place_ + ahead, length_);
  for (size_t i = 0; i < places_.size(); ++i) {
    if (places_[i] > place_ && places_[i] < end) piece.push_back(waypoints_[i]);
  }
  if (end > place_) piece.push_back(Place(end));
  return piece;
}

void PathFollower::Advance(double seconds, double allowed) {
  // From the fastest speed that can stop at the end of the path after this step.
  const double step = acceleration_ * seconds;
  const double stops = std::sqrt(step * step / 4 + 2 * acceleration_ * left()) - step / 2;
  const double wanted = std::min(allowed, std::max(0.0, stops));
  const double before = speed_;
  speed_ = std::clamp(wanted, std::max(0.0, speed_ - step), speed_ + step);
  place_ = std::min(length_, place_ + (before + speed_) / 2 * seconds);
  if (left() < kArrived) {
    place_ = length_;
    speed_ = 0;
  }
  at_ = Place(place_);
}

}  // namespace silhouette::people_experiment
