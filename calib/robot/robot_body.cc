// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/robot_body.h"

#include <algorithm>
#include <future>
#include <limits>
#include <stdexcept>

namespace silhouette {
namespace {

// The closed meshes of a link, in its frame.
std::vector<TriangleMesh> ClosedMeshes(const RobotLink& link, bool& any_open) {
  std::vector<TriangleMesh> meshes;
  for (const LinkGeometry& geometry : link.body()) {
    TriangleMesh mesh = Tessellate(geometry.shape);
    if (!IsClosed(mesh)) {
      any_open = true;
      continue;
    }
    for (Eigen::Vector3d& vertex : mesh.vertices) vertex = geometry.link_from_shape * vertex;
    meshes.push_back(std::move(mesh));
  }
  return meshes;
}

Eigen::AlignedBox3d BoxIn(const Eigen::Isometry3d& base_from_link, const Eigen::AlignedBox3d& box) {
  Eigen::AlignedBox3d result;
  for (int corner = 0; corner < 8; ++corner) {
    result.extend(base_from_link *
                  box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
  }
  return result;
}

}  // namespace

double PosedBody::AtMost(const Eigen::Vector3d& point, size_t& hint) const {
  double least = std::numeric_limits<double>::infinity();
  if (hint < links_.size() && links_[hint].field != nullptr) {
    least = links_[hint].field->AtMost(links_[hint].link_from_base * point);
  }
  // Outside a box, what is in it is at least as far away as the box.
  const auto no_nearer = [&](double squared_distance) {
    return squared_distance > 0 && (least < 0 || squared_distance >= least * least);
  };
  const size_t first = hint;
  for (size_t i = 0; i < links_.size(); ++i) {
    const Link& link = links_[i];
    if (i == first || link.field == nullptr) continue;
    if (no_nearer(link.box.squaredExteriorDistance(point))) continue;
    const Eigen::Vector3d at = link.link_from_base * point;
    if (no_nearer(link.field->box().squaredExteriorDistance(at))) continue;
    const double distance = link.field->AtMost(at);
    if (distance >= least) continue;
    least = distance;
    hint = i;
  }
  return least + tolerance_;
}

bool PosedBody::MayReach(const Eigen::Vector3d& point, double radius) const {
  return std::ranges::any_of(links_, [&](const Link& link) {
    const double reach = radius + tolerance_ + link.payload_radius;
    if (link.payload_radius > 0 && (point - link.origin).norm() <= reach) return true;
    if (link.field == nullptr || link.box.squaredExteriorDistance(point) > reach * reach) {
      return false;
    }
    return link.field->AtLeast(link.link_from_base * point) <= reach;
  });
}

PosedBody PosedBody::MovedFrom(const PosedBody& other) const {
  constexpr double kSame = 1e-9;
  PosedBody moved;
  moved.tolerance_ = tolerance_;
  for (size_t i = 0; i < links_.size(); ++i) {
    const auto difference =
        links_[i].link_from_base.matrix() - other.links_.at(i).link_from_base.matrix();
    if (difference.cwiseAbs().maxCoeff() > kSame) moved.links_.push_back(links_[i]);
  }
  return moved;
}

RobotBody::RobotBody(const RobotModel& robot, const Settings& settings)
    : robot_(robot), settings_(settings) {
  if (!(settings.tolerance >= 0) || !(settings.payload_radius >= 0) || !(settings.range > 0) ||
      !(settings.step > 0)) {
    throw std::invalid_argument("a length of the robot's body cannot be");
  }
  payload_radii_.assign(robot.links().size(), settings.payload_radius);
  std::vector<std::future<std::optional<DistanceField>>> fields;
  for (const RobotLink& link : robot.links()) {
    if (link.parent >= 0) payload_radii_[static_cast<size_t>(link.parent)] = 0;
    bool any_open = false;
    std::vector<TriangleMesh> meshes = ClosedMeshes(link, any_open);
    if (any_open) open_links_.push_back(link.name);
    fields.push_back(std::async(std::launch::async, [settings, meshes = std::move(meshes)] {
      std::optional<DistanceField> field;
      if (!meshes.empty()) field.emplace(meshes, settings.range, settings.step);
      return field;
    }));
  }
  for (auto& field : fields) fields_.push_back(field.get());
}

PosedBody RobotBody::At(std::span<const double> positions) const {
  const std::vector<Eigen::Isometry3d> base_from_link = robot_.LinkPoses(positions);
  PosedBody body;
  body.tolerance_ = settings_.tolerance;
  for (size_t i = 0; i < fields_.size(); ++i) {
    if (!fields_[i] && payload_radii_[i] == 0) continue;
    PosedBody::Link link;
    link.payload_radius = payload_radii_[i];
    link.origin = base_from_link[i].translation();
    link.link_from_base = base_from_link[i].inverse();
    if (fields_[i]) {
      link.field = &*fields_[i];
      link.box = BoxIn(base_from_link[i], fields_[i]->box());
    }
    body.links_.push_back(link);
  }
  return body;
}

}  // namespace silhouette
