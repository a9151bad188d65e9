// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/robot_body.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <variant>

#include "calib/robot/convex_hull.h"
#include "calib/robot/triangle_mesh.h"

namespace silhouette {
namespace {

// What a flat mesh is thickened by to either side, metres.
constexpr double kThickness = 0.001;

// A closed mesh that holds another one and all that it may enclose.
TriangleMesh HullAround(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> points = mesh.vertices;
  std::optional<ConvexBody> hull = HullOf(points);
  if (!hull) {
    for (const Eigen::Vector3d& vertex : mesh.vertices) {
      for (int axis = 0; axis < 3; ++axis) {
        points.emplace_back(vertex + kThickness * Eigen::Vector3d::Unit(axis));
        points.emplace_back(vertex - kThickness * Eigen::Vector3d::Unit(axis));
      }
    }
    hull = HullOf(points);
  }
  TriangleMesh surface{hull.value().vertices, hull->triangles};
  if (IsClosed(surface)) return surface;
  // Lost to rounding: its box holds it, too.
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : points) box.extend(point);
  surface = BoxMesh(box.sizes());
  for (Eigen::Vector3d& vertex : surface.vertices) vertex += box.center();
  return surface;
}

// In the link's frame.
TriangleMesh MeshOf(const LinkGeometry& geometry) {
  TriangleMesh mesh = Tessellate(geometry.shape);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex = geometry.link_from_shape * vertex;
  return mesh;
}

// By how much a shape reaches beyond its mesh, the corners of which lie on it.
double BulgeOf(const Shape& shape) {
  const double flat = std::cos(std::numbers::pi / kCircleCorners);
  if (const auto* round = std::get_if<CylinderShape>(&shape)) return round->radius * (1 - flat);
  if (const auto* ball = std::get_if<SphereShape>(&shape)) return ball->radius * (1 - flat * flat);
  return 0;
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
  if (hint < links_.size() && links_[hint].certain != nullptr) {
    const Link& link = links_[hint];
    least = link.certain->AtMost(link.link_from_base * point) + link.movement;
  }
  // Outside a box, what is in it is at least as far away as the box.
  const auto no_nearer = [&](double squared_distance) {
    return squared_distance > 0 && (least < 0 || squared_distance >= least * least);
  };
  const size_t first = hint;
  for (size_t i = 0; i < links_.size(); ++i) {
    const Link& link = links_[i];
    if (i == first || link.certain == nullptr) continue;
    if (no_nearer(link.box.squaredExteriorDistance(point))) continue;
    const Eigen::Vector3d at = link.link_from_base * point;
    if (no_nearer(link.certain->box().squaredExteriorDistance(at))) continue;
    const double distance = link.certain->AtMost(at) + link.movement;
    if (distance >= least) continue;
    least = distance;
    hint = i;
  }
  return least + tolerance_;
}

bool PosedBody::MayReach(const Eigen::Vector3d& point, double radius) const {
  return std::ranges::any_of(links_, [&](const Link& link) {
    const double reach = radius + link.tolerance + link.payload_radius + link.movement;
    if (link.payload_radius > 0 && (point - link.origin).norm() <= reach) return true;
    if (link.whole == nullptr || link.box.squaredExteriorDistance(point) > reach * reach) {
      return false;
    }
    return link.whole->AtLeast(link.link_from_base * point) <= reach;
  });
}

bool PosedBody::MayMeet(const Eigen::Vector3d& centre, double room, double radius) const {
  constexpr int kHalvings = 4;  // to squares of a sixteenth of the ball
  const Ball ball{centre, room, radius};
  return std::ranges::any_of(links_, [&](const Link& link) {
    const double reach = radius + room + link.tolerance + link.payload_radius + link.movement;
    const bool near = link.payload_radius > 0 && (centre - link.origin).norm() <= reach;
    if (!near) {
      if (link.whole == nullptr || link.box.squaredExteriorDistance(centre) > reach * reach) {
        return false;
      }
      if (link.whole->AtLeast(link.link_from_base * centre) > reach) return false;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d right = Eigen::Vector3d::Unit((axis + 1) % 3);
      const Eigen::Vector3d up = Eigen::Vector3d::Unit((axis + 2) % 3);
      for (const double side : {-1.0, 1.0}) {
        const Eigen::Vector3d middle = side * Eigen::Vector3d::Unit(axis);
        if (MayMeetOn(link, ball, middle, right, up, kHalvings)) return true;
      }
    }
    return false;
  });
}

bool PosedBody::MayMeetOn(const Link& link, const Ball& ball, const Eigen::Vector3d& middle,
                          const Eigen::Vector3d& right, const Eigen::Vector3d& up,
                          int halvings) const {
  // Of all directions that the square shows, how far, at most, from that of its middle.
  const Eigen::Vector3d outwards = middle.normalized();
  double spread = 0;
  for (int corner = 0; corner < 4; ++corner) {
    const Eigen::Vector3d at =
        middle + (corner % 2 == 0 ? right : -right) + (corner < 2 ? up : -up);
    spread = std::max(spread, (at.normalized() - outwards).norm());
  }
  // Every point of the ball's surface in question is no farther from this one than `slack`.
  const Eigen::Vector3d point = ball.centre + ball.radius * outwards;
  const double slack = ball.radius * spread + ball.room;
  const double reach = slack + link.tolerance + link.payload_radius + link.movement;
  const bool of_payload = link.payload_radius > 0 && (point - link.origin).norm() <= reach;
  const bool of_link = link.whole != nullptr &&
                       link.box.squaredExteriorDistance(point) <= reach * reach &&
                       link.whole->AtLeast(link.link_from_base * point) <= reach;
  if (!of_payload && !of_link) return false;
  // Where every joint moves the points away from the centre, so do all together.
  const bool approaches = std::ranges::any_of(link.motions, [&](const Motion& motion) {
    const Eigen::Vector3d lever = point - motion.origin;
    const Eigen::Vector3d velocity = motion.slides ? motion.axis : motion.axis.cross(lever);
    const double error =
        motion.slides ? motion.turn : motion.turn * lever.norm() + slack + motion.shift;
    return outwards.dot(velocity) - spread * velocity.norm() - error <= 0;
  });
  if (!approaches) return false;
  if (halvings == 0) return true;
  for (int quarter = 0; quarter < 4; ++quarter) {
    const Eigen::Vector3d to =
        (quarter % 2 == 0 ? right : -right) / 2 + (quarter < 2 ? up : -up) / 2;
    if (MayMeetOn(link, ball, middle + to, right / 2, up / 2, halvings - 1)) return true;
  }
  return false;
}

PosedBody PosedBody::MovedFrom(const PosedBody& other) const {
  constexpr double kSame = 1e-9;
  PosedBody moved;
  moved.tolerance_ = tolerance_;
  for (const Link& link : links_) {
    const auto before = std::ranges::find(other.links_, link.number, &Link::number);
    const bool same =
        link.movement == 0 && before != other.links_.end() &&
        (link.link_from_base.matrix() - before->link_from_base.matrix()).cwiseAbs().maxCoeff() <=
            kSame;
    if (!same) moved.links_.push_back(link);
  }
  return moved;
}

RobotBody::RobotBody(const RobotModel& robot, const Settings& settings)
    : robot_(robot), settings_(settings) {
  if (!(settings.tolerance >= 0) || !(settings.payload_radius >= 0) || !(settings.range > 0) ||
      !(settings.step > 0)) {
    throw std::invalid_argument("a length of the robot's body cannot be");
  }
  for (const bool outermost : robot.Outermost()) {
    payload_radii_.push_back(outermost ? settings.payload_radius : 0);
  }
  std::vector<std::future<Fields>> fields;
  for (const RobotLink& link : robot.links()) {
    fields.push_back(
        std::async(std::launch::async, [&link, &settings] { return FieldsOf(link, settings); }));
  }
  for (size_t i = 0; i < fields.size(); ++i) {
    fields_.push_back(fields[i].get());
    if (fields_[i].certain != fields_[i].whole) open_links_.push_back(robot.links()[i].name);
  }
}

RobotBody::Fields RobotBody::FieldsOf(const RobotLink& link, const Settings& settings) {
  const auto field_of = [&](const std::vector<TriangleMesh>& meshes) {
    return meshes.empty()
               ? nullptr
               : std::make_shared<const DistanceField>(meshes, settings.range, settings.step);
  };
  std::vector<TriangleMesh> certain;
  std::vector<TriangleMesh> whole;
  bool same = true;
  double bulge = 0;
  for (const LinkGeometry& geometry : link.body(settings.geometry)) {
    bulge = std::max(bulge, BulgeOf(geometry.shape));
    const TriangleMesh mesh = MeshOf(geometry);
    const bool closed = IsClosed(mesh);
    if (closed) certain.push_back(mesh);
    std::vector<TriangleMesh> solids = closed ? SolidsOf(mesh) : std::vector<TriangleMesh>();
    same = same && solids.size() == 1;
    if (solids.empty()) solids.push_back(HullAround(mesh));
    std::ranges::move(solids, std::back_inserter(whole));
  }
  Fields fields{.certain = field_of(certain), .whole = nullptr, .bulge = bulge};
  fields.whole = same ? fields.certain : field_of(whole);
  return fields;
}

PosedBody RobotBody::At(std::span<const double> positions,
                        std::span<const double> half_ranges) const {
  PosedBody body;
  body.tolerance_ = settings_.tolerance;
  std::vector<double> half(half_ranges.begin(), half_ranges.end());
  half.resize(positions.size(), 0);
  AddLinks(positions, half, /*still=*/true, body);
  return body;
}

PosedBody RobotBody::Between(std::span<const double> from, std::span<const double> to,
                             double fine) const {
  PosedBody body;
  body.tolerance_ = settings_.tolerance;
  std::vector<double> half(from.size());
  for (size_t j = 0; j < half.size(); ++j) half[j] = (to[j] - from[j]) / 2;
  std::vector<int> pieces(half.size(), 1);
  size_t poses = 1;
  const auto middle = [&](size_t j, int piece) { return from[j] + (2 * piece + 1) * half[j]; };
  std::vector<double> positions(half.size());
  while (2 * poses <= kMostPoses) {
    for (size_t j = 0; j < half.size(); ++j) positions[j] = middle(j, pieces[j] / 2);
    const std::vector<Eigen::Isometry3d> base_from_link = robot_.LinkPoses(positions);
    // The joint that moves a link the most.
    size_t joint = half.size();
    double farthest = fine;
    for (size_t j = 0; j < half.size(); ++j) {
      std::vector<double> alone(half.size(), 0);
      alone[j] = half[j];
      for (size_t i = 0; i < fields_.size(); ++i) {
        const double movement = MovementOf(i, base_from_link, alone);
        if (movement <= farthest) continue;
        farthest = movement;
        joint = j;
      }
    }
    if (joint == half.size()) break;
    half[joint] /= 2;
    pieces[joint] *= 2;
    poses *= 2;
  }
  for (size_t pose = 0; pose < poses; ++pose) {
    size_t left = pose;
    for (size_t j = 0; j < half.size(); ++j) {
      positions[j] = middle(j, static_cast<int>(left) % pieces[j]);
      left /= static_cast<size_t>(pieces[j]);
    }
    AddLinks(positions, half, /*still=*/pose == 0, body);
  }
  return body;
}

double RobotBody::MovementOf(size_t link, std::span<const Eigen::Isometry3d> base_from_link,
                             std::span<const double> half_ranges) const {
  std::vector<Eigen::Vector3d> points;
  if (payload_radii_[link] > 0) points.push_back(base_from_link[link].translation());
  if (fields_[link].whole) {
    for (int corner = 0; corner < 8; ++corner) {
      points.push_back(
          base_from_link[link] *
          fields_[link].whole->box().corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
    }
  }
  return MovementOf(points, static_cast<int>(link), base_from_link, half_ranges);
}

double RobotBody::MovementOf(std::span<const Eigen::Vector3d> points, int link,
                             std::span<const Eigen::Isometry3d> base_from_link,
                             std::span<const double> half_ranges) const {
  // One joint moves after the other, the outermost first. A point then has moved by no more than
  // those moved it, and is by no more than that farther from the axis of the next one.
  double movement = 0;
  for (int at = link; at >= 0;) {
    const RobotLink& moved = robot_.links()[static_cast<size_t>(at)];
    if (moved.joint >= 0) {
      const auto joint = static_cast<size_t>(moved.joint);
      const Eigen::Isometry3d& frame = base_from_link[static_cast<size_t>(at)];
      const Eigen::Vector3d axis = frame.linear() * moved.axis;
      double farthest = 0;
      for (const Eigen::Vector3d& point : points) {
        farthest = std::max(farthest, (point - frame.translation()).cross(axis).norm());
      }
      movement +=
          std::abs(moved.factor * half_ranges[joint]) * (moved.slides ? 1 : farthest + movement);
    }
    at = moved.parent;
  }
  return movement;
}

std::vector<PosedBody::Motion> RobotBody::MotionsOf(
    size_t link, std::span<const Eigen::Isometry3d> base_from_link,
    std::span<const double> half_ranges) const {
  std::vector<PosedBody::Motion> motions;
  for (int at = static_cast<int>(link); at >= 0;) {
    const RobotLink& moved = robot_.links()[static_cast<size_t>(at)];
    const double half =
        moved.joint < 0 ? 0 : moved.factor * half_ranges[static_cast<size_t>(moved.joint)];
    if (half != 0) {
      // The joints outside this one are found already: it turns their axes.
      for (PosedBody::Motion& outer : motions) outer.turn += moved.slides ? 0 : std::abs(half);
      const Eigen::Isometry3d& frame = base_from_link[static_cast<size_t>(at)];
      PosedBody::Motion motion;
      motion.axis = frame.linear() * moved.axis * (half > 0 ? 1 : -1);
      motion.origin = frame.translation();
      motion.slides = moved.slides;
      motion.shift = MovementOf({&motion.origin, 1}, moved.parent, base_from_link, half_ranges);
      motions.push_back(motion);
    }
    at = moved.parent;
  }
  return motions;
}

void RobotBody::AddLinks(std::span<const double> positions, std::span<const double> half_ranges,
                         bool still, PosedBody& body) const {
  const std::vector<Eigen::Isometry3d> base_from_link = robot_.LinkPoses(positions);
  for (size_t i = 0; i < fields_.size(); ++i) {
    if (!fields_[i].whole && payload_radii_[i] == 0) continue;
    PosedBody::Link link;
    link.number = i;
    link.movement = MovementOf(i, base_from_link, half_ranges);
    if (link.movement == 0 && !still) continue;
    link.motions = MotionsOf(i, base_from_link, half_ranges);
    link.tolerance = settings_.tolerance + fields_[i].bulge;
    link.payload_radius = payload_radii_[i];
    link.origin = base_from_link[i].translation();
    link.link_from_base = base_from_link[i].inverse();
    link.certain = fields_[i].certain.get();
    if (fields_[i].whole) {
      link.whole = fields_[i].whole.get();
      link.box = BoxIn(base_from_link[i], fields_[i].whole->box());
    }
    body.links_.push_back(link);
  }
}

}  // namespace silhouette
