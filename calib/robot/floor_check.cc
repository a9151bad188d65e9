// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/floor_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "db/mask/interpolation.h"

namespace silhouette {
namespace {

// Radians by which an axis may be off the vertical or horizontal: URDFs round their angles.
constexpr double kLevel = 1e-3;

KinematicChain ChainOfAllJoints(const RobotModel& robot) {
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints()) names.push_back(joint.name);
  return robot.ChainOf(names, {}).value();
}

// Whether the link's joint raises or lowers it, if no joint before does.
bool IsRaised(const ChainLink& link, const Eigen::Isometry3d& base_from_link) {
  if (link.joint < 0) return false;
  const Eigen::Vector3d axis = base_from_link.linear() * link.axis;
  return (link.slides ? std::abs(axis.z()) : axis.head<2>().norm()) > kLevel;
}

double LowestOf(std::span<const LinkBall> balls, const Eigen::Isometry3d& base_from_link) {
  const Eigen::RowVector3d up = base_from_link.linear().row(2);
  double lowest = std::numeric_limits<double>::infinity();
  for (const LinkBall& ball : balls) lowest = std::min(lowest, up.dot(ball.point) - ball.radius);
  return lowest + base_from_link.translation().z();
}

}  // namespace

FloorCheck::FloorCheck(const RobotModel& robot, BodyGeometry geometry, double floor, size_t carrier,
                       double carried)
    : floor_(floor), chain_(ChainOfAllJoints(robot)) {
  std::vector<Eigen::Isometry3d> base_from_link;
  chain_.Pose(std::vector<double>(robot.joints().size()), base_from_link);
  std::vector<bool> raised(robot.links().size());
  for (size_t i = 1; i < raised.size(); ++i) {
    const RobotLink& link = robot.links()[i];
    raised[i] = raised[static_cast<size_t>(link.parent)] || IsRaised(link, base_from_link[i]);
    if (!raised[i]) continue;
    Link& added = links_.emplace_back(Link{i, OuterBalls(link, geometry), {}});
    added.balls.push_back({Eigen::Vector3d::Zero(), i == carrier ? carried : 0});
    double radius = 0;
    for (const LinkBall& ball : added.balls) {
      radius = std::max(radius, ball.point.norm() + ball.radius);
    }
    for (size_t joint = 0; joint < robot.joints().size(); ++joint) {
      added.levers.push_back(chain_.LeverOf(joint, i, radius));
    }
  }
}

std::optional<size_t> FloorCheck::Below(std::span<const double> from,
                                        std::span<const double> to) const {
  if (from.size() != chain_.joints().size() || to.size() != from.size()) {
    throw std::invalid_argument("not a value for each joint");
  }
  // By link: no point of it moves farther on the whole way.
  std::vector<double> ways;
  for (const Link& link : links_) {
    double& way = ways.emplace_back(0);
    for (size_t j = 0; j < from.size(); ++j) way += std::abs(to[j] - from[j]) * link.levers[j];
    if (!std::isfinite(way)) throw std::invalid_argument("a joint value is not finite");
  }
  std::vector<double> q(from.size());
  std::vector<Eigen::Isometry3d> base_from_link;
  // From the end back to the start, as far at a time as no link can get down to the floor.
  for (double at = 1; at > 0;) {
    Interpolate(from, to, at, q);
    chain_.Pose(q, base_from_link);
    double step = at;
    for (size_t i = 0; i < links_.size(); ++i) {
      const size_t number = links_[i].number;
      const double above = LowestOf(links_[i].balls, base_from_link[number]) - floor_;
      if (!(above >= 0)) return number;
      step = std::min(step, std::max(above, kFloorStep) / ways[i]);
    }
    at -= step;
  }
  return std::nullopt;
}

}  // namespace silhouette
