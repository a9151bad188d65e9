// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_kind.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <stdexcept>
#include <utility>

#include "calib/robot/drawing/swept_bodies.h"

namespace silhouette {
namespace {

// Whether a node does not say where the link stands on its parent: its joint stands for any value,
// or follows one that turns without end and is not back after a turn.
bool IsOfWrist(const ChainLink& link, const ConfigurationGrid& grid) {
  if (link.joint < 0) return false;
  const GridJoint& joint = grid.joints()[static_cast<size_t>(link.joint)];
  const bool turns_back = !link.slides && link.factor == std::round(link.factor);
  return joint.any() || (joint.continuous && !turns_back);
}

// The first such link on the way to `link`; -1: there is none.
int FirstOfWrist(const KinematicChain& chain, const ConfigurationGrid& grid, size_t link) {
  int first = -1;
  for (int at = static_cast<int>(link); at >= 0;) {
    const ChainLink& here = chain.links()[static_cast<size_t>(at)];
    if (IsOfWrist(here, grid)) first = at;
    at = here.parent;
  }
  return first;
}

std::vector<JointRange> RangesOf(const ConfigurationGrid& grid) {
  std::vector<JointRange> ranges;
  for (const GridJoint& joint : grid.joints()) {
    ranges.push_back({joint.lower, joint.upper, joint.continuous});
  }
  return ranges;
}

// Views that widen all outlines by what drawing the robot alone may add to them (PartDrawer).
std::vector<PartDrawer> Widened(std::span<const PartDrawer> views) {
  constexpr double kAdded = 0.2;  // pixels
  std::vector<PartDrawer> widened;
  for (const PartDrawer& view : views) {
    widened.emplace_back(view.camera(), view.size(), view.margin() + kAdded);
  }
  return widened;
}

// How far a point of the part moves at most from a node to the joint values nearest to it.
double MoveInHalfSteps(const KinematicChain& chain, const ConfigurationGrid& grid,
                       const RobotPart& part) {
  // Beyond half a step: what the grid and the joints' limits tolerate, and more.
  constexpr double kHalf = 0.5 + 1e-5;
  constexpr double kTolerated = 1e-5;
  const double reach = part.points.colwise().norm().maxCoeff() + part.radius;
  double move = 0;
  for (size_t joint = 0; joint < grid.joints().size(); ++joint) {
    const double way = kHalf * grid.joints()[joint].step() + kTolerated;
    move += way * chain.LeverOf(joint, part.moves_with, reach);
  }
  return move;
}

}  // namespace

std::string NameOf(DrawnKind kind) {
  switch (kind) {
    case DrawnKind::kWhole:
      return "whole";
    case DrawnKind::kOwn:
      return "own";
    case DrawnKind::kReach:
      return "reach";
  }
  return "";
}

std::vector<DrawnKind> KindsFor(const ConfigurationGrid& grid) {
  if (std::ranges::any_of(grid.joints(), &GridJoint::any)) {
    return {DrawnKind::kOwn, DrawnKind::kReach};
  }
  return {DrawnKind::kWhole};
}

NodeCell CellOf(const ConfigurationGrid& grid, Configuration node) {
  NodeCell cell{node, std::move(node)};
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    const double half = (joint.any() ? joint.upper - joint.lower : joint.step()) / 2;
    cell.from[j] -= half;
    cell.to[j] += half;
    if (joint.continuous) continue;
    cell.from[j] = std::max(cell.from[j], joint.lower);
    cell.to[j] = std::min(cell.to[j], joint.upper);
  }
  return cell;
}

DrawnRobot AsKind(const DrawnRobot& robot, const ConfigurationGrid& grid, DrawnKind kind) {
  const KinematicChain& chain = robot.chain();
  if (!std::ranges::equal(grid.joints(), chain.joints(), {}, &GridJoint::name, &ChainJoint::name)) {
    throw std::invalid_argument("the grid's joints are not those that move the drawn robot");
  }
  if (kind == DrawnKind::kWhole) return robot;
  std::vector<RobotPart> parts;
  std::map<int, std::vector<RobotPart>> of_wrist;  // by its first link
  for (const RobotPart& part : robot.parts()) {
    const int first = FirstOfWrist(chain, grid, part.moves_with);
    (first < 0 ? parts : of_wrist[first]).push_back(part);
  }
  if (kind == DrawnKind::kOwn) {
    if (parts.empty()) {
      throw std::invalid_argument(
          "every part of the robot moves with a joint that stands for any value: nothing is left "
          "to draw of the arm");
    }
    return {chain, std::move(parts), robot.views()};
  }
  const std::vector<JointRange> ranges = RangesOf(grid);
  for (const auto& [link, moved] : of_wrist) {
    for (RobotPart& body : SweptBodies(chain, static_cast<size_t>(link), moved, ranges)) {
      parts.push_back(std::move(body));
    }
  }
  for (RobotPart& part : parts) {
    part.radius += MoveInHalfSteps(chain, grid, part);
    part.inner = {};
  }
  return {chain, std::move(parts), Widened(robot.views())};
}

}  // namespace silhouette
