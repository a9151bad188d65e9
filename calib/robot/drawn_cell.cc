// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawn_cell.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "calib/robot/convex_hull.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

bool IsLength(double metres) { return std::isfinite(metres) && metres >= 0; }

// What remains of a hull's points if it shrinks by `depth`; none: nothing.
Eigen::Matrix3Xd ShrunkPoints(const Eigen::Matrix3Xd& points, double depth) {
  std::vector<Eigen::Vector3d> of_hull;
  for (const auto& point : points.colwise()) of_hull.emplace_back(point);
  const std::optional<ConvexBody> hull = HullOf(of_hull);
  const std::optional<ConvexBody> shrunk = hull ? Shrunk(*hull, depth) : std::nullopt;
  Eigen::Matrix3Xd result(3, shrunk ? shrunk->vertices.size() : 0);
  for (Eigen::Index i = 0; i < result.cols(); ++i) {
    result.col(i) = shrunk->vertices[static_cast<size_t>(i)];
  }
  return result;
}

// Grows the parts by how far fixed joints may move them, and shrinks what is certain of them.
absl::Status AddFixedJoints(const DrawnCell& cell, std::span<const std::string> moving,
                            std::span<const FixedJoint> fixed, std::vector<RobotPart>& parts) {
  if (fixed.empty() || cell.fixed_joint_tolerance == 0) return absl::OkStatus();
  std::vector<std::string> all(moving.begin(), moving.end());
  for (const FixedJoint& joint : fixed) all.push_back(joint.name);
  ASSIGN_OR_RETURN(const KinematicChain chain, cell.robot->ChainOf(all, {}));
  std::vector<ChainJoint> joints(chain.joints().begin(), chain.joints().end());
  for (size_t i = 0; i < fixed.size(); ++i) {
    ChainJoint& joint = joints[moving.size() + i];
    joint.lower = fixed[i].position - cell.fixed_joint_tolerance;
    joint.upper = fixed[i].position + cell.fixed_joint_tolerance;
  }
  const DrawnRobot loose(
      KinematicChain(std::move(joints), {chain.links().begin(), chain.links().end()}), parts, {});
  for (size_t part = 0; part < parts.size(); ++part) {
    double moved = 0;
    for (size_t i = 0; i < fixed.size(); ++i) {
      moved += cell.fixed_joint_tolerance * loose.Lever(part, moving.size() + i);
    }
    if (moved == 0) continue;
    parts[part].radius += moved;
    if (parts[part].inner.cols() > 0) {
      parts[part].inner = ShrunkPoints(parts[part].inner, moved);
    }
  }
  return absl::OkStatus();
}

absl::Status NoLength() {
  return absl::InvalidArgumentError(
      "what is added to the drawn robot is missing, negative or not finite");
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
  if (!IsLength(cell.payload_radius) || !IsLength(cell.fixed_joint_tolerance) ||
      !(link_growth.empty() || link_growth.size() == links)) {
    return NoLength();
  }
  ASSIGN_OR_RETURN(const DrawnRobot bare, DrawnRobotOf(*cell.robot, cell.parts, moving, fixed,
                                                       calibration, mask_sizes, margin));
  const std::vector<bool> outermost = cell.robot->Outermost();
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
  RETURN_IF_ERROR(AddFixedJoints(cell, moving, fixed, parts));
  DrawnRobot drawn(bare.chain(), std::move(parts), bare.views());
  if (link_growth.empty()) return drawn;
  return Grown(drawn, link_growth);
}

std::vector<std::string> UncertainLinks(const RobotModel& robot, const DrawnRobot& drawn) {
  std::vector<bool> certain(robot.links().size());
  std::vector<bool> drawn_at_all(robot.links().size());
  for (const RobotPart& part : drawn.parts()) {
    drawn_at_all[part.link] = true;
    if (part.inner.cols() > 0) certain[part.link] = true;
  }
  std::vector<std::string> names;
  for (size_t link = 0; link < certain.size(); ++link) {
    const bool has_body = drawn_at_all[link] && !robot.links()[link].body().empty();
    if (has_body && !certain[link]) names.push_back(robot.links()[link].name);
  }
  return names;
}

}  // namespace silhouette
