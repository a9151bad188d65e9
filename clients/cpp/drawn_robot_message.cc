// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/camera/camera_model.h"
#include "calib/robot/drawing/drawn_places.h"
#include "clients/cpp/drawn_space.h"

namespace silhouette::client {
namespace {

// What calibrations and models are rounded to is far less; a number that got lost is more.
constexpr double kRotationTolerance = 1e-3;

template <typename Values>
void RequireCount(const Values& values, int count, const char* what) {
  if (values.size() == count) return;
  throw std::invalid_argument(
      absl::StrCat(what, " has ", values.size(), " numbers instead of ", count));
}

Eigen::Isometry3d PoseFrom(const v1::Pose& message) {
  RequireCount(message.rotation(), 9, "a rotation");
  RequireCount(message.translation(), 3, "a translation");
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      pose.linear()(row, column) = message.rotation(3 * row + column);
    }
    pose.translation()[row] = message.translation(row);
  }
  const Eigen::Matrix3d turn = pose.linear();
  const Eigen::Matrix3d rest = turn * turn.transpose() - Eigen::Matrix3d::Identity();
  if (!(rest.cwiseAbs().maxCoeff() < kRotationTolerance) || !(turn.determinant() > 0)) {
    throw std::invalid_argument("a rotation is none");
  }
  return pose;
}

KinematicChain ChainFrom(const v1::DrawnRobot& message) {
  std::vector<ChainJoint> joints;
  for (const v1::DrawnJoint& joint : message.joints()) {
    joints.push_back({.name = joint.name(),
                      .lower = joint.lower(),
                      .upper = joint.upper(),
                      .continuous = joint.continuous()});
  }
  std::vector<ChainLink> links;
  for (const v1::DrawnLink& link : message.links()) {
    RequireCount(link.axis(), 3, "an axis");
    const Eigen::Vector3d axis(link.axis(0), link.axis(1), link.axis(2));
    if (link.joint() >= 0 && !(std::abs(axis.norm() - 1) < kRotationTolerance)) {
      throw std::invalid_argument("an axis has not the length 1");
    }
    links.push_back({.parent = link.parent(),
                     .joint = link.joint(),
                     .slides = link.slides(),
                     .factor = link.factor(),
                     .offset = link.offset(),
                     .parent_from_link = PoseFrom(link.parent_from_link()),
                     .axis = axis});
  }
  if (links.empty()) throw std::invalid_argument("a robot has at least one link");
  return {std::move(joints), std::move(links)};
}

std::vector<RobotPart> PartsFrom(const v1::DrawnRobot& message) {
  std::vector<RobotPart> parts;
  for (const v1::DrawnPart& part : message.parts()) {
    const int points = part.points_size() / 3;
    RequireCount(part.points(), 3 * points, "a part's list of points");
    parts.push_back({.link = part.moves_with(),
                     .moves_with = part.moves_with(),
                     .points = Eigen::Map<const Eigen::Matrix3Xd>(part.points().data(), 3, points),
                     .radius = part.radius(),
                     .inner = {}});
  }
  return parts;
}

PartDrawer ViewFrom(const v1::DrawnView& view) {
  CameraIntrinsics in{.width = view.width(),
                      .height = view.height(),
                      .fx = view.fx(),
                      .fy = view.fy(),
                      .cx = view.cx(),
                      .cy = view.cy()};
  RequireCount(view.distortion(), static_cast<int>(in.distortion.size()), "a lens");
  std::ranges::copy(view.distortion(), in.distortion.begin());
  return {CameraModel(in, PoseFrom(view.camera_from_world())),
          {view.width(), view.height()},
          view.margin()};
}

JointRegions ForbiddenFrom(const v1::DrawnRobot& message) {
  std::vector<JointRegions::Region> regions;
  for (const v1::ForbiddenRegion& region : message.forbidden()) {
    JointRegions::Region& ranges = regions.emplace_back();
    for (const v1::ForbiddenRange& range : region.ranges()) {
      ranges.push_back({.joint = range.joint(),
                        .continuous = range.continuous(),
                        .lower = range.lower(),
                        .upper = range.upper()});
    }
  }
  return JointRegions(std::move(regions));
}

}  // namespace

absl::StatusOr<std::shared_ptr<const ServedRobot>> FromMessage(const v1::DrawnRobot& message,
                                                               const ConfigurationGrid& grid) {
  try {
    std::vector<PartDrawer> views;
    std::vector<std::string> names;
    for (const v1::DrawnView& view : message.views()) {
      views.push_back(ViewFrom(view));
      names.push_back(view.view());
    }
    if (views.empty()) throw std::invalid_argument("no view sees it");
    JointRegions forbidden = ForbiddenFrom(message);
    auto robot = std::make_shared<const DrawnRobot>(ChainFrom(message), PartsFrom(message),
                                                    std::move(views));
    RequireDrawnPlaces(robot->chain(), grid, forbidden);
    return std::make_shared<const ServedRobot>(
        ServedRobot{std::move(robot), grid, std::move(forbidden), std::move(names)});
  } catch (const std::invalid_argument& error) {
    return absl::InternalError(absl::StrCat("the drawn robot cannot be: ", error.what()));
  }
}

}  // namespace silhouette::client
