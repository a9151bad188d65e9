// SPDX-License-Identifier: Apache-2.0
// What robot images of a cell are drawn from.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/parts.h"
#include "calib/robot/robot_model.h"
#include "db/mask/joint_regions.h"

namespace silhouette {

struct DrawnCell {
  std::shared_ptr<const RobotModel> robot;
  PartSettings parts;
  // How far tool and payload reach beyond the outermost links, metres.
  double payload_radius = 0;
  // By how much a fixed joint may stand elsewhere than it is stated, radians or metres.
  double fixed_joint_tolerance = 0.005;
  // Where the robot must never be: of the grid's joints, in their order.
  JointRegions forbidden = {};
  // The same as text, one region a line: equal texts forbid the same. Stored with drawn images.
  std::string forbidden_text{};
};

// The robot to draw, with all that is to be added to it in the radii of its parts: the tolerance,
// `link_growth` (metres, by link of the model; empty: none), on the outermost links tool and
// payload, about the links' origins as well, and by how far fixed joints may move it within their
// tolerance; what is certain is shrunk by the same. Otherwise as the DrawnRobotOf of parts.h.
// InvalidArgument, too: a length or tolerance is negative or not finite, or there is not a growth
// for each link.
absl::StatusOr<DrawnRobot> DrawnRobotOf(const DrawnCell& cell, std::span<const std::string> moving,
                                        std::span<const FixedJoint> fixed,
                                        const Calibration& calibration,
                                        std::span<const MaskSize> mask_sizes, double margin,
                                        std::span<const double> link_growth = {});

// The same robot with `link_growth`, metres, by link of its model, in the radii of the links'
// parts. InvalidArgument: a growth is negative or not finite, or there is none for a part's link.
absl::StatusOr<DrawnRobot> Grown(const DrawnRobot& robot, std::span<const double> link_growth);

// Names of the links that have a body of which nothing is certain: of meshes that are not closed,
// thin, or far from convex. No pixel shows for certain that such a link is not where it is drawn.
std::vector<std::string> UncertainLinks(const RobotModel& robot, const DrawnRobot& drawn);

}  // namespace silhouette
