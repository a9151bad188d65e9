// SPDX-License-Identifier: Apache-2.0
// Convex bodies that hold all that a joint and those beyond it can move parts of a robot to. Uses
// the standard library and Eigen alone.
#pragma once

#include <span>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"

namespace silhouette {

// The values of a joint that are counted with: all from lower to upper, or a whole turn.
struct JointRange {
  double lower = 0;
  double upper = 0;
  bool turn = false;
};

// Parts that move with the parent of `link`, a link with a joint, and hold `parts`, at least one,
// all of which move with `link` or a link beyond it, wherever the joint of `link` and those beyond
// it stand within `ranges`, by joint of the chain. They are round about the joint's axis: a range
// of less than a turn counts as one.
std::vector<RobotPart> SweptBodies(const KinematicChain& chain, size_t link,
                                   std::span<const RobotPart> parts,
                                   std::span<const JointRange> ranges);

}  // namespace silhouette
