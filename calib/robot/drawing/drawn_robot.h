// SPDX-License-Identifier: Apache-2.0
// DrawnRobot: the masks that views have of a robot, drawn from its convex parts at any joint
// values. Uses the standard library and Eigen alone.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "calib/robot/drawing/hull_edges.h"
#include "calib/robot/drawing/kinematic_chain.h"
#include "calib/robot/drawing/part_balls.h"
#include "calib/robot/drawing/part_drawer.h"
#include "db/mask/mask.h"

namespace silhouette {

// A convex part of a robot's link. Lengths in metres; points as columns in the frame of the link
// that it moves with.
struct RobotPart {
  size_t link = 0;  // that it is of, by its index in the model
  // That it moves with: a part that is round about its joint's axis moves with the link before.
  size_t moves_with = 0;
  // All of the model's part is in the hull of `points`, grown by `radius`.
  Eigen::Matrix3Xd points;
  double radius = 0;
  // The hull of `inner` is in the true part, wherever within the model's tolerance its surface is.
  // No columns: nothing is certain.
  Eigen::Matrix3Xd inner;
};

// By part of the robot: how far it is grown, metres, finite and not negative. Empty: by nothing.
using Growth = std::span<const double>;

// A value; used by any number of threads, each with scratch of its own. `q`: joint values in the
// order of chain().joints(); as many, else std::invalid_argument is thrown. Limits are not looked
// at.
class DrawnRobot {
 public:
  // The cameras' world is the frame of the chain's first link. Throws std::invalid_argument if
  // there are no parts, a part has no points, one that is not finite or a negative radius, or it
  // moves with a link that is not in the chain.
  DrawnRobot(KinematicChain chain, std::vector<RobotPart> parts, std::vector<PartDrawer> views);

  const KinematicChain& chain() const { return chain_; }
  const std::vector<RobotPart>& parts() const { return parts_; }
  // By part: of the hull of its points.
  const std::vector<HullEdges>& edges() const { return edges_; }
  const std::vector<PartDrawer>& views() const { return views_; }
  const PartBalls& balls() const { return balls_; }
  // By view.
  const std::vector<BallLook>& looks() const { return looks_; }

  // How far a point of the part moves at most, metres, per radian or metre of the joint: 0 if the
  // joint does not move it. Holds for all joint values within the limits, and along the way.
  double Lever(size_t part, size_t joint) const { return levers_[part * joints_ + joint]; }

  // Whether a part that joints can move, grown, is anywhere beyond the box, which is in the frame
  // of the chain's first link. `base_from_link`: KinematicChain::Pose.
  bool Leaves(const Eigen::AlignedBox3d& box, std::span<const Eigen::Isometry3d> base_from_link,
              Growth growth) const;

  // Sets every pixel of a view that the grown robot touches. `base_from_link`: as above. Throws
  // std::invalid_argument if `growth` has not a number for each part.
  void AddTouched(size_t view, std::span<const Eigen::Isometry3d> base_from_link, Growth growth,
                  DrawingScratch& scratch, std::span<uint64_t> words) const;

  // Sets pixels that certainly show nothing but the robot.
  void AddCovered(size_t view, std::span<const Eigen::Isometry3d> base_from_link,
                  DrawingScratch& scratch, std::span<uint64_t> words) const;

  // The same as masks, one a view; every part grown by `growth`.
  std::vector<Mask> Touched(std::span<const double> q, double growth = 0) const;
  std::vector<Mask> Covered(std::span<const double> q) const;

 private:
  KinematicChain chain_;
  std::vector<RobotPart> parts_;
  std::vector<HullEdges> edges_;
  std::vector<PartDrawer> views_;
  PartBalls balls_;
  std::vector<BallLook> looks_;
  size_t joints_ = 0;
  std::vector<double> levers_;  // by part, then joint
};

}  // namespace silhouette
