// SPDX-License-Identifier: Apache-2.0
#include "server/collision/separation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include "calib/robot/drawing/motion_check.h"
#include "db/mask/interpolation.h"

namespace silhouette {
namespace {

void RequireNotNegative(double value, const std::string& name) {
  if (!(value >= 0 && std::isfinite(value))) {
    throw std::invalid_argument(name + " must not be negative, and be finite");
  }
}

}  // namespace

void RequireValid(const SeparationSettings& settings) {
  RequireNotNegative(settings.human_speed, "human_speed");
  RequireNotNegative(settings.near_human_speed, "near_human_speed");
  if (settings.near_human_speed < settings.human_speed) {
    throw std::invalid_argument("near_human_speed: it is at least human_speed");
  }
  RequireNotNegative(settings.reaction_time, "reaction_time");
  RequireNotNegative(settings.intrusion, "intrusion");
  RequireNotNegative(settings.uncertainty, "uncertainty");
  if (settings.levels.empty()) throw std::invalid_argument("levels: at least one is needed");
  std::set<std::string> names;
  double slower = 0;
  for (const SpeedLevel& level : settings.levels) {
    if (level.name.empty() || !names.insert(level.name).second) {
      throw std::invalid_argument("levels: each needs a name of its own");
    }
    RequireNotNegative(level.speed, "levels: speed");
    RequireNotNegative(level.stopping_time, "levels: stopping_time");
    RequireNotNegative(level.stopping_distance, "levels: stopping_distance");
    if (!(level.speed > slower)) {
      throw std::invalid_argument("levels: they go from slow to fast, each with a positive speed");
    }
    slower = level.speed;
  }
}

double ProtectiveDistance(const SeparationSettings& settings, const SpeedLevel& level,
                          double image_to_reply) {
  const double time = image_to_reply + settings.reaction_time + level.stopping_time;
  const auto with = [&](double human_speed) {
    return human_speed * time + settings.intrusion + settings.uncertainty;
  };
  const double near = with(settings.near_human_speed);
  return near <= kNear ? near : std::max(kNear, with(settings.human_speed));
}

double WayToStop(const SeparationSettings& settings, const SpeedLevel& level,
                 double image_to_reply) {
  return level.speed * (image_to_reply + settings.reaction_time) + level.stopping_distance;
}

std::optional<KeptLevels> LevelsKept(
    std::span<const double> distances,
    const std::function<std::optional<PathDistance>(size_t level)>& along) {
  KeptLevels kept;
  for (size_t level = 0; level < distances.size(); ++level) {
    const std::optional<PathDistance> path = along(level);
    if (!path) return std::nullopt;
    const bool keeps = path->distance >= distances[level];
    if (keeps || level == 0) kept.path = *path;
    if (!keeps) break;
    ++kept.count;
  }
  return kept;
}

SeparationMeter::SeparationMeter(const DrawnRobot& robot, const SpaceDistances& space)
    : robot_(robot), space_(space) {
  for (const RobotPart& part : robot.parts()) bodies_.emplace_back(part.points, part.radius);
}

void SeparationMeter::FindMoving(std::span<const Configuration> waypoints) {
  const size_t joints = waypoints.front().size();
  std::vector<bool> changes(joints, waypoints.size() == 1);
  for (size_t i = 1; i < waypoints.size(); ++i) {
    for (size_t joint = 0; joint < joints; ++joint) {
      if (waypoints[i][joint] != waypoints[i - 1][joint]) changes[joint] = true;
    }
  }
  moves_.assign(robot_.parts().size(), false);
  for (size_t part = 0; part < moves_.size(); ++part) {
    // One that is round about its joint looks the same; what it was grown by, a cable or a payload,
    // goes round.
    const size_t link = robot_.parts()[part].link;
    for (size_t joint = 0; joint < joints; ++joint) {
      if (changes[joint] && robot_.chain().LeverOf(joint, link, 1) > 0) moves_[part] = true;
    }
  }
}

double SeparationMeter::At(std::span<const double> q, double at_most) {
  robot_.chain().Pose(q, poses_);
  double least = at_most;
  const size_t first = nearest_;
  for (size_t i = 0; i < bodies_.size() && least > 0; ++i) {
    // Its distance is soon less than that of most others.
    const size_t part = i == 0 ? first : (i <= first ? i - 1 : i);
    if (!moves_[part]) continue;
    bodies_[part].Place(poses_[robot_.parts()[part].moves_with]);
    const double distance = space_.Distance(bodies_[part], least);
    if (distance >= least) continue;
    least = distance;
    nearest_ = part;
  }
  return std::max(0.0, least);
}

std::optional<PathDistance> SeparationMeter::Along(std::span<const Configuration> waypoints,
                                                   std::optional<double> horizon,
                                                   const Stop& stop) {
  FindMoving(waypoints);
  PathDistance path;
  path.distance = path.at_start = At(waypoints.front(), space_.range());
  double left = horizon.value_or(std::numeric_limits<double>::infinity());
  double last = path.at_start;  // at the place before, at least
  before_ = poses_;
  Configuration q = waypoints.front();
  for (size_t segment = 0; segment + 1 < waypoints.size(); ++segment) {
    const Configuration& from = waypoints[segment];
    const Configuration& to = waypoints[segment + 1];
    for (size_t joint = 0; joint < from.size(); ++joint) {
      if (!std::isfinite(to[joint] - from[joint])) return std::nullopt;
    }
    const double movement = GreatestDisplacement(robot_, from, to);
    if (!std::isfinite(movement)) return std::nullopt;
    const double steps = std::max(1.0, std::ceil(movement / kStep));
    const double moved = movement / steps;
    for (double step = 1; step <= steps && path.distance > 0; ++step) {
      if (left <= 0) return path;
      if (Stopped(stop)) return std::nullopt;
      Interpolate(from, to, step / steps, q);
      // Farther than this it changes nothing: at the place before it was path.distance or more.
      const double at = At(q, std::min(path.distance + moved, space_.range()));
      if (std::isfinite(left)) left -= DisplacementBetween(robot_, before_, poses_);
      before_.swap(poses_);
      // Between the two it falls by no more than it can rise again on the rest of the way.
      const double between = std::max(0.0, std::min({last, at, (last + at - moved) / 2}));
      if (between < path.distance) {
        path.distance = between;
        path.segment = static_cast<int>(segment);
        path.fraction = (at <= last ? step : step - 1) / steps;
      }
      last = at;
    }
  }
  path.whole = true;
  return path;
}

}  // namespace silhouette
