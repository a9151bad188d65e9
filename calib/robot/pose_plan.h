// SPDX-License-Identifier: Apache-2.0
// PosePlan: where to drive the robot next so that the cameras see the board that it carries, from
// many sides and in many places - without knowing where cameras and board are.
//
// At first poses as unlike as possible are tried. Where a view saw the board, it is likely to see
// it near there as well; most later poses are such, for the view that has seen least, yet not the
// same as any before.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "calib/robot/robot_model.h"

namespace silhouette {

// A joint that may be moved: its place in RobotModel::joints(), and how far.
struct MovingJoint {
  size_t joint = 0;
  double lower = 0;
  double upper = 0;
};

class PosePlan {
 public:
  using Positions = std::vector<double>;  // of all joints of the robot
  // Whether the robot may be driven there from where it is.
  using Allowed = std::function<bool(const Positions&)>;

  // `flange`: index of the link that carries the board. `rest`: where joints stand that are not in
  // `joints`. Throws std::invalid_argument if there are more or fewer values than joints, no joint
  // to move, or one that the robot does not have. The same seed and answers give the same poses.
  PosePlan(const RobotModel& robot, size_t flange, Positions rest, std::vector<MovingJoint> joints,
           uint64_t seed);

  // Where to go next; nothing if chance finds no pose that is allowed.
  std::optional<Positions> Next(const Allowed& allowed);

  // That the robot was there, and which views saw the board.
  void Tell(const Positions& positions, std::span<const std::string> views);

 private:
  struct Stand {
    Eigen::Vector3d place;        // of the flange, in the base
    Eigen::Vector3d direction;    // of its z axis
    std::set<std::string> views;  // that saw the board from there
  };

  // In metres, turns included.
  static double DistanceBetween(const Stand& a, const Stand& b);
  Stand StandAt(const Positions& positions) const;
  // The view that has seen the board least often, but has seen it; empty: none has.
  std::string ViewInNeed() const;

  const RobotModel robot_;
  const size_t flange_;
  const Positions rest_;
  const std::vector<MovingJoint> joints_;
  std::mt19937_64 random_;
  std::vector<Stand> tried_;
  std::map<std::string, int> seen_;  // how often, by view
};

}  // namespace silhouette
