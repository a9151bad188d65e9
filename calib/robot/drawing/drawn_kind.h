// SPDX-License-Identifier: Apache-2.0
// DrawnKind: what is drawn of a robot for a configuration of its grid. Uses the standard library
// and Eigen alone.
//
// A grid may have joints with one value that stands for any (GridJoint::any()): those of the wrist.
// A configuration of such a grid is a node of the arm. It has two images instead of one. Its own
// image shows what no wrist joint moves: an obstacle in it is in the way whatever the wrist does.
// Its reach image holds the robot at all joint values whose nearest node it is: without an obstacle
// in it all of them are free. It has every pixel that the robot's image there has, unless a part
// may be beside or behind the camera: then PartDrawer sets more pixels for the robot than show it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/configuration_grid.h"

namespace silhouette {

enum class DrawnKind : uint8_t {
  kWhole = 0,  // the robot at the configuration
  kOwn,        // what no joint that stands for any moves, at the configuration
  kReach,      // all of the robot at any joint values nearest to the configuration
};

// "whole", "own", "reach".
std::string NameOf(DrawnKind kind);

// The kinds that are drawn for a grid: kWhole, or for nodes of an arm kOwn and kReach.
std::vector<DrawnKind> KindsFor(const ConfigurationGrid& grid);

// All joint values whose nearest node stands at `node`, along each joint. Beyond the rim of a joint
// that turns without end the values go on.
struct NodeCell {
  Configuration from;
  Configuration to;
};
NodeCell CellOf(const ConfigurationGrid& grid, Configuration node);

// The robot whose image at ConfigurationGrid::At is of that kind, seen by the same cameras. Its
// joints are the robot's; those that stand for any move nothing of it. kReach: convex bodies that
// hold all that a wrist joint moves take its place, and all is grown by what half a grid step moves
// it. Throws std::invalid_argument if the grid's joints are not the robot's, in their order; kOwn:
// if there is nothing to draw; kReach: if a slide follows a joint that turns without end.
DrawnRobot AsKind(const DrawnRobot& robot, const ConfigurationGrid& grid, DrawnKind kind);

}  // namespace silhouette
