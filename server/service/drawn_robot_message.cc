// SPDX-License-Identifier: Apache-2.0
// A drawn robot as a message, to the last bit.
#include <Eigen/Geometry>

#include "calib/robot/drawing/drawn_robot.h"
#include "server/service/messages.h"

namespace silhouette {
namespace {

void PoseToMessage(const Eigen::Isometry3d& pose, v1::Pose* message) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) message->add_rotation(pose.linear()(row, column));
  }
  for (int row = 0; row < 3; ++row) message->add_translation(pose.translation()[row]);
}

void LinkToMessage(const ChainLink& link, v1::DrawnLink* message) {
  message->set_parent(link.parent);
  message->set_joint(link.joint);
  message->set_slides(link.slides);
  message->set_factor(link.factor);
  message->set_offset(link.offset);
  PoseToMessage(link.parent_from_link, message->mutable_parent_from_link());
  message->mutable_axis()->Add(link.axis.data(), link.axis.data() + 3);
}

void ViewToMessage(const PartDrawer& view, v1::DrawnView* message) {
  const CameraIntrinsics& in = view.camera().intrinsics();
  message->set_width(view.size().width);
  message->set_height(view.size().height);
  message->set_margin(view.margin());
  message->set_fx(in.fx);
  message->set_fy(in.fy);
  message->set_cx(in.cx);
  message->set_cy(in.cy);
  message->mutable_distortion()->Add(in.distortion.begin(), in.distortion.end());
  PoseToMessage(view.camera().camera_from_world(), message->mutable_camera_from_world());
}

}  // namespace

void ToMessage(const ServedDatabase& database, v1::DrawnRobot* message) {
  const DrawnRobot& robot = *database.robot_images().drawn();
  for (const ChainJoint& joint : robot.chain().joints()) {
    v1::DrawnJoint& added = *message->add_joints();
    added.set_name(joint.name);
    added.set_lower(joint.lower);
    added.set_upper(joint.upper);
    added.set_continuous(joint.continuous);
  }
  for (const ChainLink& link : robot.chain().links()) LinkToMessage(link, message->add_links());
  for (const RobotPart& part : robot.parts()) {
    v1::DrawnPart& added = *message->add_parts();
    added.set_moves_with(static_cast<uint32_t>(part.moves_with));
    added.set_radius(part.radius);
    added.mutable_points()->Add(part.points.data(), part.points.data() + part.points.size());
  }
  for (size_t view = 0; view < robot.views().size(); ++view) {
    v1::DrawnView& added = *message->add_views();
    ViewToMessage(robot.views()[view], &added);
    added.set_view(database.view_name(static_cast<int>(view)));
  }
  for (const JointRegions::Region& region : database.robot_images().forbidden().regions()) {
    v1::ForbiddenRegion& added = *message->add_forbidden();
    for (const RegionRange& range : region) {
      v1::ForbiddenRange& bounds = *added.add_ranges();
      bounds.set_joint(static_cast<uint32_t>(range.joint));
      bounds.set_lower(range.lower);
      bounds.set_upper(range.upper);
      bounds.set_continuous(range.continuous);
    }
  }
}

}  // namespace silhouette
