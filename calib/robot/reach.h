// SPDX-License-Identifier: Apache-2.0
// Reach: how far the MaxMove discretisation must reckon a joint to move the robot's points.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/robot_model.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"

namespace silhouette {

// r of joint `joint` in metres: no point of the robot, tool or payload outboard of the joint is
// ever farther from its axis, whatever values the joints `moving` take within their limits while
// the others stand at `fixed`. 1 where the joint slides. Where others mimic it, what they add: no
// point ever moves by more than r metres per radian, or metre, of the joint.
//
// It is the exact distance where no moving joint is outboard. Over outboard moving joints it is the
// sum of the links' lengths, exact for an arm that can stretch straight out at right angles to the
// axis, else larger than need be.
//
// `payload_radius`: how far, in metres, tool and payload reach beyond the outermost links; 0: the
// model's geometry is all there is.
//
// InvalidArgument: `joint` is not in the model, `payload_radius` is negative, `moving` or `fixed`
// name a joint that is not in the model, or a joint outboard is in neither.
absl::StatusOr<double> Reach(const RobotModel& robot, const std::string& joint,
                             std::span<const std::string> moving, std::span<const FixedJoint> fixed,
                             double payload_radius);

// A box, in the base's frame, that the robot never leaves, tool, payload and the origins of its
// links included; the arguments and errors are those of Reach. Exact where nothing moves; over
// moving joints as large as if every link could stretch straight out in every direction.
absl::StatusOr<Eigen::AlignedBox3d> ReachBox(const RobotModel& robot,
                                             std::span<const std::string> moving,
                                             std::span<const FixedJoint> fixed,
                                             double payload_radius);

// A link beyond a face of a box.
struct LinkBeyond {
  size_t link = 0;
  int face = 0;           // the lower ones across x, y and z, then the upper ones
  double by = 0;          // metres
  std::vector<double> q;  // where
};

// How a link leaves `box`, in the base's frame, farthest, while the joints `moving` take any values
// of their ranges that are not `forbidden`; nothing if none does. Links that none of them moves may
// be anywhere. Tool and payload reach `payload_radius` beyond the outermost links. It is searched
// from configurations all over the ranges: a link may leave it a little farther, never less.
// InvalidArgument: as Reach().
absl::StatusOr<std::optional<LinkBeyond>> FarthestBeyond(
    const RobotModel& robot, BodyGeometry geometry, std::span<const GridJoint> moving,
    std::span<const FixedJoint> fixed, const JointRegions& forbidden, double payload_radius,
    const Eigen::AlignedBox3d& box);

// Everything within `radius`, metres, of `point`, in a link's frame.
struct LinkBall {
  Eigen::Vector3d point;
  double radius = 0;
};

// Balls whose convex hull holds the link's body, without those inside; none if it has no geometry.
std::vector<LinkBall> OuterBalls(const RobotLink& link, BodyGeometry geometry);

// How much of space the robot's surface sweeps in a step of each of the joints `moving`: surface
// times way, in cubic metres, the mean over their ranges. By a sample of the surface. `steps`: one
// a joint, radians or metres. InvalidArgument: as Reach().
absl::StatusOr<std::vector<double>> MeanSweeps(const RobotModel& robot,
                                               std::span<const std::string> moving,
                                               std::span<const FixedJoint> fixed,
                                               std::span<const double> steps);

}  // namespace silhouette
