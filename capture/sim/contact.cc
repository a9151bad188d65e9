// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/contact.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include "calib/robot/reach.h"

namespace silhouette {
namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;

std::shared_ptr<Model> ModelOf(const TriangleMesh& mesh) {
  std::vector<fcl::Triangle> triangles;
  for (const auto& [a, b, c] : mesh.triangles) triangles.emplace_back(a, b, c);
  auto model = std::make_shared<Model>();
  model->beginModel(static_cast<int>(triangles.size()), static_cast<int>(mesh.vertices.size()));
  model->addSubModel(mesh.vertices, triangles);
  model->endModel();
  return model;
}

// Whether `point` lies inside: the solid angle that the triangles fill, seen from it, is that of a
// whole sphere (van Oosterom & Strackee 1983).
bool Encloses(const TriangleMesh& mesh, const Eigen::Vector3d& point) {
  double angle = 0;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[triangle[0]] - point;
    const Eigen::Vector3d b = mesh.vertices[triangle[1]] - point;
    const Eigen::Vector3d c = mesh.vertices[triangle[2]] - point;
    const double la = a.norm();
    const double lb = b.norm();
    const double lc = c.norm();
    angle += 2 * std::atan2(a.dot(b.cross(c)),
                            la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return std::abs(angle) > 2 * std::numbers::pi;
}

// A vertex of every connected piece of a mesh: if no surfaces cross, each piece is inside another
// body as a whole or not at all.
std::vector<Eigen::Vector3d> OneVertexPerPiece(const TriangleMesh& mesh) {
  std::vector<uint32_t> root(mesh.vertices.size());
  for (uint32_t i = 0; i < root.size(); ++i) root[i] = i;
  const auto find = [&](uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    root[find(a)] = find(b);
    root[find(b)] = find(c);
  }
  std::vector<bool> used(root.size(), false);
  std::vector<Eigen::Vector3d> vertices;
  for (const auto& triangle : mesh.triangles) {
    const uint32_t piece = find(triangle[0]);
    if (!used[piece]) vertices.push_back(mesh.vertices[triangle[0]]);
    used[piece] = true;
  }
  return vertices;
}

}  // namespace

struct ContactChecker::Body {
  explicit Body(const BodyPart& part)
      : name(part.name),
        frame(part.frame),
        mesh(part.mesh),
        model(ModelOf(part.mesh)),
        pieces(OneVertexPerPiece(part.mesh)) {
    for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex);
    for (const Eigen::Vector3d& vertex : mesh.vertices) {
      radius = std::max(radius, (vertex - box.center()).norm());
    }
  }

  // Whether a piece of `other` starts inside this body.
  bool Holds(const Eigen::Isometry3d& this_from_other, const Body& other) const {
    return std::any_of(other.pieces.begin(), other.pieces.end(),
                       [&](const Eigen::Vector3d& vertex) {
                         const Eigen::Vector3d point = this_from_other * vertex;
                         return box.contains(point) && Encloses(mesh, point);
                       });
  }

  // The corners of `other` that lie inside this body, in the world, at most `most`.
  void AddCorners(const Eigen::Isometry3d& world_from_this, const Body& other,
                  const Eigen::Isometry3d& world_from_other, size_t most,
                  std::vector<Eigen::Vector3d>& points) const {
    const Eigen::Isometry3d this_from_world = world_from_this.inverse();
    size_t added = 0;
    for (const Eigen::Vector3d& vertex : other.mesh.vertices) {
      if (added == most) return;
      const Eigen::Vector3d in_world = world_from_other * vertex;
      const Eigen::Vector3d point = this_from_world * in_world;
      if (!box.contains(point) || !Encloses(mesh, point)) continue;
      points.push_back(in_world);
      ++added;
    }
  }

  std::string name;
  size_t frame;
  TriangleMesh mesh;
  std::shared_ptr<Model> model;
  std::vector<Eigen::Vector3d> pieces;
  Eigen::AlignedBox3d box;
  double radius = 0;  // of a ball around the box's centre that holds the body
};

ContactChecker::ContactChecker(const RobotModel& robot, std::span<const Obstacle> obstacles) {
  for (const BodyPart& part : BodyPartsOf(robot)) robot_.emplace_back(part);
  for (const BodyPart& part : ObstacleParts(obstacles)) obstacles_.emplace_back(part);
}

ContactChecker::~ContactChecker() = default;

bool ContactChecker::Touch(const Body& link, const Eigen::Isometry3d& world_from_link,
                           const Body& obstacle, const Eigen::Isometry3d& world_from_obstacle) {
  const Eigen::Isometry3d link_from_obstacle = world_from_link.inverse() * world_from_obstacle;
  fcl::CollisionResultd crossing;
  return fcl::collide(link.model.get(), world_from_link, obstacle.model.get(), world_from_obstacle,
                      fcl::CollisionRequestd(), crossing) > 0 ||
         link.Holds(link_from_obstacle, obstacle) ||
         obstacle.Holds(link_from_obstacle.inverse(), link);
}

bool ContactChecker::Touches(const Poses& links, const Poses& obstacles) const {
  for (const Body& link : robot_) {
    const Eigen::Vector3d centre = links[link.frame] * link.box.center();
    for (const Body& obstacle : obstacles_) {
      const Eigen::Vector3d other = obstacles[obstacle.frame] * obstacle.box.center();
      if ((centre - other).norm() > link.radius + obstacle.radius) continue;
      if (Touch(link, links[link.frame], obstacle, obstacles[obstacle.frame])) return true;
    }
  }
  return false;
}

std::vector<ContactPoint> ContactChecker::Points(const Poses& links, const Poses& obstacles,
                                                 size_t most) const {
  std::vector<ContactPoint> points;
  for (const Body& link : robot_) {
    const Eigen::Isometry3d& world_from_link = links[link.frame];
    for (const Body& obstacle : obstacles_) {
      const Eigen::Isometry3d& world_from_obstacle = obstacles[obstacle.frame];
      if (!Touch(link, world_from_link, obstacle, world_from_obstacle)) continue;
      std::vector<Eigen::Vector3d> places;
      fcl::CollisionResultd crossing;
      fcl::collide(link.model.get(), world_from_link, obstacle.model.get(), world_from_obstacle,
                   fcl::CollisionRequestd(most, true), crossing);
      for (size_t i = 0; i < crossing.numContacts(); ++i) {
        places.push_back(crossing.getContact(i).pos);
      }
      link.AddCorners(world_from_link, obstacle, world_from_obstacle, most, places);
      obstacle.AddCorners(world_from_obstacle, link, world_from_link, most, places);
      for (const Eigen::Vector3d& place : places) {
        points.push_back({.point = place, .link = link.name, .obstacle = obstacle.name});
      }
    }
  }
  return points;
}

Contact ContactChecker::Check(const Poses& links, const Poses& obstacles) const {
  struct Pair {
    double at_least;  // metres between the two
    const Body* link;
    const Body* obstacle;
  };
  std::vector<Pair> pairs;
  for (const Body& link : robot_) {
    const Eigen::Vector3d centre = links[link.frame] * link.box.center();
    for (const Body& obstacle : obstacles_) {
      const Eigen::Vector3d other = obstacles[obstacle.frame] * obstacle.box.center();
      pairs.push_back({(centre - other).norm() - link.radius - obstacle.radius, &link, &obstacle});
    }
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& a, const Pair& b) { return a.at_least < b.at_least; });

  Contact contact;
  for (const auto& [at_least, link, obstacle] : pairs) {
    if (at_least >= contact.distance) break;
    const Eigen::Isometry3d& world_from_link = links[link->frame];
    const Eigen::Isometry3d& world_from_obstacle = obstacles[obstacle->frame];
    double distance = 0;
    const bool touching = Touch(*link, world_from_link, *obstacle, world_from_obstacle);
    if (!touching) {
      fcl::DistanceResultd nearest(contact.distance);
      fcl::distance(link->model.get(), world_from_link, obstacle->model.get(), world_from_obstacle,
                    fcl::DistanceRequestd(), nearest);
      distance = std::max(nearest.min_distance, 0.0);
      if (distance >= contact.distance) continue;
    }
    contact = {
        .touching = touching, .distance = distance, .link = link->name, .obstacle = obstacle->name};
    if (touching) break;
  }
  return contact;
}

MotionChecker::MotionChecker(const RobotModel& robot, const ContactChecker& checker)
    : robot_(robot), checker_(checker) {
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints()) names.push_back(joint.name);
  for (const RobotJoint& joint : robot.joints()) {
    // Every joint moves: Reach has nothing left to refuse.
    reach_.push_back(Reach(robot, joint.name, names, {}, 0).value());
  }
}

MotionContact MotionChecker::Check(std::span<const double> from, std::span<const double> to,
                                   const Poses& obstacles) const {
  std::vector<double> way;
  double travel = 0;  // metres that any point moves at most
  for (size_t j = 0; j < from.size(); ++j) {
    way.push_back(to[j] - from[j]);
    travel += reach_[j] * std::abs(way[j]);
  }
  MotionContact nearest;
  for (double fraction = 0;;) {
    std::vector<double> positions(from.begin(), from.end());
    for (size_t j = 0; j < way.size(); ++j) positions[j] += fraction * way[j];
    const Contact contact = checker_.Check(robot_.LinkPoses(positions), obstacles);
    if (nearest.positions.empty() || contact.distance < nearest.contact.distance) {
      nearest = {.fraction = fraction, .positions = positions, .contact = contact};
    }
    if (contact.touching || fraction >= 1 || travel == 0) return nearest;
    fraction = std::min(1.0, fraction + std::clamp(contact.distance, kFine, kCoarse) / travel);
  }
}

}  // namespace silhouette
