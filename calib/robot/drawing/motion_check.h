// SPDX-License-Identifier: Apache-2.0
// CheckMotion: whether a robot is free all along a straight motion of its joints.
//
// A part that is grown at the middle of a motion by as much as any of its points is away from there
// at either end holds the part at every place of the motion. So the motion is free if the grown
// robot is: a continuous proof. Else it is halved.
#pragma once

#include <functional>
#include <span>

#include "calib/robot/drawing/drawn_robot.h"

namespace silhouette {

// Steps below which a motion is sampled and no longer proven: a tenth of a pixel at 64 pixels over
// 3 m.
inline constexpr double kMotionResolution = 0.005;  // metres

struct MotionCheck {
  bool free = false;
  // Free: 0: proven all along. Else some of it is not: it was found free at places between which no
  // point of the robot moves farther than this, metres.
  double sampled_step = 0;
  // Not free: of the way, the first place that was found not free, ungrown. 0 to 1.
  double fraction = 0;
  int checks = 0;  // calls of `is_free`
};

// What CheckMotion asks about: the robot at `q`, each part grown by `growth`.
struct MotionPlace {
  std::span<const double> q;
  Growth growth;
  double fraction = 0;  // of the way, where q is
  // The stretch of the way that all of is free if the grown robot is. Without growth, one that is
  // not proven, of which this is an end or the middle.
  double first = 0;
  double last = 0;
};

// `is_free(place)`: whether the robot is free there; if it is, so is it with less growth. Called
// along the motion, first half first, until a place is not free. Stretches on which no point moves
// farther than `resolution`, metres, and that are not proven, are decided ungrown at their ends and
// middle. The proof holds between configurations within the
// joints' limits, which are not looked at; values of continuous joints count as they are, not by
// the shorter way. Throws std::invalid_argument if there is not a finite value for each joint, or
// `resolution` is not above 0.
MotionCheck CheckMotion(const DrawnRobot& robot, std::span<const double> from,
                        std::span<const double> to, double resolution,
                        const std::function<bool(const MotionPlace&)>& is_free);

// How far a point of the robot moves at most along the motion, metres: CheckMotion makes no more
// than about 8 calls for each `resolution` of it.
double GreatestDisplacement(const DrawnRobot& robot, std::span<const double> from,
                            std::span<const double> to);

// How far the corners of the robot's parts are from where they were, the farthest, metres: no more
// than the fastest point moves on any way between the two. Links' poses as KinematicChain::Pose has
// them.
double DisplacementBetween(const DrawnRobot& robot, std::span<const Eigen::Isometry3d> from,
                           std::span<const Eigen::Isometry3d> to);

}  // namespace silhouette
