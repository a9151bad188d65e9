// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawn_cell.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

bool IsLength(double metres) { return std::isfinite(metres) && metres >= 0; }

// By link, whether no link hangs on it.
std::vector<bool> OutermostLinks(const RobotModel& robot) {
  std::vector<bool> outermost(robot.links().size(), true);
  for (const RobotLink& link : robot.links()) {
    if (link.parent >= 0) outermost[static_cast<size_t>(link.parent)] = false;
  }
  return outermost;
}

absl::Status NoLength() {
  return absl::InvalidArgumentError(
      "a length that is added to the drawn robot is missing, negative or not finite");
}

}  // namespace

absl::StatusOr<DrawnRobot> Grown(const DrawnRobot& robot, std::span<const double> link_growth) {
  if (!std::ranges::all_of(link_growth, IsLength)) return NoLength();
  std::vector<RobotPart> parts = robot.parts();
  for (RobotPart& part : parts) {
    if (part.link >= link_growth.size()) return NoLength();
    part.radius += link_growth[part.link];
  }
  return DrawnRobot(robot.chain(), std::move(parts), robot.views());
}

absl::StatusOr<DrawnRobot> DrawnRobotOf(const DrawnCell& cell, std::span<const std::string> moving,
                                        std::span<const FixedJoint> fixed,
                                        const Calibration& calibration,
                                        std::span<const MaskSize> mask_sizes, double margin,
                                        std::span<const double> link_growth) {
  if (cell.robot == nullptr) return absl::InvalidArgumentError("there is no robot to draw");
  const size_t links = cell.robot->links().size();
  if (!IsLength(cell.payload_radius) || !(link_growth.empty() || link_growth.size() == links)) {
    return NoLength();
  }
  ASSIGN_OR_RETURN(const DrawnRobot bare, DrawnRobotOf(*cell.robot, cell.parts, moving, fixed,
                                                       calibration, mask_sizes, margin));
  const std::vector<bool> outermost = OutermostLinks(*cell.robot);
  std::vector<double> added(links, cell.parts.tolerance);
  std::vector<RobotPart> parts = bare.parts();
  for (size_t link = 0; link < links; ++link) {
    if (!outermost[link] || cell.payload_radius == 0) continue;
    added[link] += cell.payload_radius;
    parts.push_back({.link = link,
                     .moves_with = link,
                     .points = Eigen::Vector3d::Zero(),
                     .radius = 0,
                     .inner = {}});
  }
  for (RobotPart& part : parts) part.radius += added[part.link];
  DrawnRobot drawn(bare.chain(), std::move(parts), bare.views());
  if (link_growth.empty()) return drawn;
  return Grown(drawn, link_growth);
}

}  // namespace silhouette
