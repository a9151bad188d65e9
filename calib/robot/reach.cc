// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/reach.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "calib/robot/convex_hull.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Ball = LinkBall;

// Distance of a point from the axis, point or plane that reach is measured from; grows by no more
// than the length of the step when the point moves.
using Distance = std::function<double(const Eigen::Vector3d&)>;

// Balls whose convex hull holds the shape.
struct BallsOfShape {
  std::vector<Ball> operator()(const SphereShape& sphere) const {
    return {{Eigen::Vector3d::Zero(), sphere.radius}};
  }
  std::vector<Ball> operator()(const CylinderShape& cylinder) const {
    // The polygon around the true circle, not the one inscribed.
    const double corner = cylinder.radius / std::cos(std::numbers::pi / kCircleCorners);
    return BallsOf(CylinderMesh(corner, cylinder.length));
  }
  std::vector<Ball> operator()(const BoxShape& box) const { return BallsOf(BoxMesh(box.size)); }
  std::vector<Ball> operator()(const MeshShape& mesh) const { return BallsOf(*mesh.mesh); }

  static std::vector<Ball> BallsOf(const TriangleMesh& mesh) {
    std::vector<Ball> balls;
    for (const Eigen::Vector3d& vertex : mesh.vertices) balls.push_back({vertex, 0});
    return balls;
  }
};

class ReachFinder {
 public:
  ReachFinder(const RobotModel& robot, std::map<size_t, double> fixed, double payload_radius)
      : robot_(robot), fixed_(std::move(fixed)), children_(robot.links().size()) {
    const std::vector<bool> outermost = robot.Outermost();
    for (size_t i = 1; i < robot.links().size(); ++i) {
      children_[static_cast<size_t>(robot.links()[i].parent)].push_back(i);
    }
    for (size_t i = 0; i < robot.links().size(); ++i) {
      const RobotLink& link = robot.links()[i];
      std::vector<Ball> balls{{Eigen::Vector3d::Zero(), 0}};
      for (const std::vector<LinkGeometry>* geometries : {&link.visual, &link.collision}) {
        for (const LinkGeometry& geometry : *geometries) {
          for (const Ball& ball : std::visit(BallsOfShape(), geometry.shape)) {
            balls.push_back({geometry.link_from_shape * ball.point, ball.radius});
          }
        }
      }
      for (Ball& ball : balls) ball.radius += outermost[i] ? payload_radius : 0;
      balls_.push_back(std::move(balls));
    }
  }

  // Upper bound of `distance` over every point of `link` and of all links outboard of it.
  double Farthest(size_t link, const Eigen::Isometry3d& frame_from_link,
                  const Distance& distance) const {
    double farthest = std::numeric_limits<double>::lowest();
    for (const Ball& ball : balls_[link]) {
      farthest = std::max(farthest, distance(frame_from_link * ball.point) + ball.radius);
    }
    for (size_t child : children_[link]) {
      farthest = std::max(farthest, FarthestBeyond(child, frame_from_link, distance));
    }
    return farthest;
  }

 private:
  double FarthestBeyond(size_t child, const Eigen::Isometry3d& frame_from_parent,
                        const Distance& distance) const {
    const RobotLink& link = robot_.links()[child];
    const auto at = [&](double position) {
      return frame_from_parent * ParentFromLink(link, position);
    };
    if (link.joint < 0) {
      return Farthest(child, frame_from_parent * link.parent_from_link, distance);
    }
    const RobotJoint& joint = robot_.joints()[static_cast<size_t>(link.joint)];
    const auto fixed = fixed_.find(static_cast<size_t>(link.joint));
    if (fixed != fixed_.end()) return Farthest(child, at(fixed->second), distance);
    if (link.slides) {
      // Distances are convex along a line: the ends are the farthest.
      return std::max(Farthest(child, at(joint.lower), distance),
                      Farthest(child, at(joint.upper), distance));
    }
    // The joint's origin stands still, and no point ever gets farther from it than it is now.
    const Distance from_origin = [](const Eigen::Vector3d& p) { return p.norm(); };
    return distance(at(0).translation()) +
           Farthest(child, Eigen::Isometry3d::Identity(), from_origin);
  }

  const RobotModel& robot_;
  const std::map<size_t, double> fixed_;  // by index of the joint
  std::vector<std::vector<size_t>> children_;
  std::vector<std::vector<Ball>> balls_;  // by link
};

// Whether link `outer` is `inner` or hangs on it.
bool IsOutboard(const RobotModel& robot, size_t inner, size_t outer) {
  for (int link = static_cast<int>(outer); link >= 0;
       link = robot.links()[static_cast<size_t>(link)].parent) {
    if (static_cast<size_t>(link) == inner) return true;
  }
  return false;
}

// The joints that move, and where the others stand; by index.
struct KnownJoints {
  std::set<size_t> joints;
  std::map<size_t, double> positions;
};

absl::StatusOr<KnownJoints> Find(const RobotModel& robot, std::span<const std::string> moving,
                                 std::span<const FixedJoint> fixed) {
  KnownJoints known;
  for (const std::string& name : moving) {
    const std::optional<size_t> found = robot.JointIndex(name);
    if (!found) return robot.NoJoint(name);
    known.joints.insert(*found);
  }
  for (const FixedJoint& at : fixed) {
    const std::optional<size_t> found = robot.JointIndex(at.name);
    if (!found) return robot.NoJoint(at.name);
    known.joints.insert(*found);
    known.positions[*found] = at.position;
  }
  return known;
}

// Every joint outboard of link `first` moves or has a position.
absl::Status RequireAllKnown(const RobotModel& robot, size_t first, const KnownJoints& known) {
  for (size_t link = first + 1; link < robot.links().size(); ++link) {
    const int outboard = robot.links()[link].joint;
    if (outboard >= 0 && IsOutboard(robot, first, link) &&
        !known.joints.contains(static_cast<size_t>(outboard))) {
      return InvalidArgument("joint '", robot.joints()[static_cast<size_t>(outboard)].name,
                             "' neither moves nor has a fixed position");
    }
  }
  return absl::OkStatus();
}

absl::Status RequireRadius(double payload_radius) {
  if (payload_radius >= 0) return absl::OkStatus();
  return InvalidArgument("the payload's radius must not be below 0");
}

}  // namespace

absl::StatusOr<double> Reach(const RobotModel& robot, const std::string& joint,
                             std::span<const std::string> moving, std::span<const FixedJoint> fixed,
                             double payload_radius) {
  RETURN_IF_ERROR(RequireRadius(payload_radius));
  const std::optional<size_t> index = robot.JointIndex(joint);
  if (!index) return robot.NoJoint(joint);
  ASSIGN_OR_RETURN(const KnownJoints known, Find(robot, moving, fixed));
  const ReachFinder finder(robot, known.positions, payload_radius);
  // By link: what the joint moves its points, and those of all outboard, by itself or by what
  // mimics it.
  std::vector<double> moved(robot.links().size(), 0);
  for (size_t i = moved.size() - 1; i > 0; --i) {
    const RobotLink& link = robot.links()[i];
    if (link.joint == static_cast<int>(*index)) {
      RETURN_IF_ERROR(RequireAllKnown(robot, i, known));
      const Distance from_axis = [&](const Eigen::Vector3d& p) {
        return link.axis.cross(p).norm();
      };
      const double reach =
          link.slides ? 1 : finder.Farthest(i, Eigen::Isometry3d::Identity(), from_axis);
      moved[i] += std::abs(link.factor) * reach;
    }
    double& of_parent = moved[static_cast<size_t>(link.parent)];
    of_parent = std::max(of_parent, moved[i]);
  }
  return moved[0];
}

absl::StatusOr<Eigen::AlignedBox3d> ReachBox(const RobotModel& robot,
                                             std::span<const std::string> moving,
                                             std::span<const FixedJoint> fixed,
                                             double payload_radius) {
  RETURN_IF_ERROR(RequireRadius(payload_radius));
  ASSIGN_OR_RETURN(const KnownJoints known, Find(robot, moving, fixed));
  RETURN_IF_ERROR(RequireAllKnown(robot, 0, known));
  const ReachFinder finder(robot, known.positions, payload_radius);
  const auto along = [&](const Eigen::Vector3d& direction) {
    const Distance distance = [&](const Eigen::Vector3d& p) { return direction.dot(p); };
    return finder.Farthest(0, Eigen::Isometry3d::Identity(), distance);
  };
  Eigen::AlignedBox3d box;
  for (int axis = 0; axis < 3; ++axis) {
    box.min()[axis] = -along(-Eigen::Vector3d::Unit(axis));
    box.max()[axis] = along(Eigen::Vector3d::Unit(axis));
  }
  return box;
}

namespace {

// Points on a link's surface, and the surface that each stands for.
struct SurfaceSample {
  std::vector<Eigen::Vector3d> points;
  std::vector<double> areas;
};

SurfaceSample SampleOf(const RobotLink& link) {
  constexpr size_t kMost = 200;  // of a shape
  SurfaceSample sample;
  for (const LinkGeometry& geometry : link.body()) {
    const TriangleMesh mesh = Tessellate(geometry.shape);
    const size_t stride = mesh.triangles.size() / kMost + 1;
    for (size_t i = 0; i < mesh.triangles.size(); i += stride) {
      const auto& corners = mesh.triangles[i];
      const Eigen::Vector3d& a = mesh.vertices[static_cast<size_t>(corners[0])];
      const Eigen::Vector3d& b = mesh.vertices[static_cast<size_t>(corners[1])];
      const Eigen::Vector3d& c = mesh.vertices[static_cast<size_t>(corners[2])];
      sample.points.push_back(geometry.link_from_shape * Eigen::Vector3d((a + b + c) / 3));
      sample.areas.push_back((b - a).cross(c - a).norm() / 2 * static_cast<double>(stride));
    }
  }
  return sample;
}

}  // namespace

absl::StatusOr<std::vector<double>> MeanSweeps(const RobotModel& robot,
                                               std::span<const std::string> moving,
                                               std::span<const FixedJoint> fixed,
                                               std::span<const double> steps) {
  if (steps.size() != moving.size()) throw std::invalid_argument("not a step for each joint");
  ASSIGN_OR_RETURN(const KinematicChain chain, robot.ChainOf(moving, fixed));
  std::vector<SurfaceSample> samples;
  for (const RobotLink& link : robot.links()) samples.push_back(SampleOf(link));
  constexpr int kConfigurations = 50;
  std::mt19937_64 random;  // the same numbers every time
  std::vector<double> sweeps(moving.size(), 0);
  std::vector<Eigen::Isometry3d> here;
  std::vector<Eigen::Isometry3d> there;
  for (int i = 0; i < kConfigurations; ++i) {
    std::vector<double> q;
    for (const ChainJoint& joint : chain.joints()) {
      q.push_back(std::uniform_real_distribution(joint.lower, joint.upper)(random));
    }
    chain.Pose(q, here);
    for (size_t j = 0; j < q.size(); ++j) {
      std::vector<double> next = q;
      next[j] += steps[j];
      chain.Pose(next, there);
      for (size_t link = 0; link < samples.size(); ++link) {
        const SurfaceSample& sample = samples[link];
        for (size_t k = 0; k < sample.points.size(); ++k) {
          const Eigen::Vector3d& point = sample.points[k];
          sweeps[j] += sample.areas[k] * (there[link] * point - here[link] * point).norm();
        }
      }
    }
  }
  for (double& sweep : sweeps) sweep /= kConfigurations;
  return sweeps;
}

std::vector<LinkBall> OuterBalls(const RobotLink& link, BodyGeometry kind) {
  std::vector<Ball> balls;
  for (const LinkGeometry& geometry : link.body(kind)) {
    std::vector<Ball> of_shape = std::visit(BallsOfShape(), geometry.shape);
    std::vector<Eigen::Vector3d> points;
    for (const Ball& ball : of_shape) points.push_back(ball.point);
    if (const std::optional<ConvexBody> hull = HullOf(points)) {
      of_shape.clear();
      for (const Eigen::Vector3d& vertex : hull->vertices) of_shape.push_back({vertex, 0});
    }
    for (const Ball& ball : of_shape) {
      balls.push_back({geometry.link_from_shape * ball.point, ball.radius});
    }
  }
  return balls;
}

namespace {

// Searches for the configuration where a link is farthest beyond a face.
class BeyondFinder {
 public:
  BeyondFinder(const RobotModel& robot, BodyGeometry geometry, KinematicChain chain,
               std::span<const GridJoint> moving, const JointRegions& forbidden,
               double payload_radius, const Eigen::AlignedBox3d& box)
      : chain_(std::move(chain)), moving_(moving), forbidden_(forbidden), box_(box) {
    const std::vector<bool> outermost = robot.Outermost();
    for (size_t link = 0; link < robot.links().size(); ++link) {
      bool moves = false;
      for (size_t joint = 0; joint < moving.size(); ++joint) {
        moves = moves || chain_.LeverOf(joint, link, 1) > 0;
      }
      balls_.push_back(moves ? OuterBalls(robot.links()[link], geometry) : std::vector<Ball>());
      if (!moves || !outermost[link] || payload_radius == 0) continue;
      balls_[link].push_back({Eigen::Vector3d::Zero(), 0});
      for (Ball& ball : balls_[link]) ball.radius += payload_radius;
    }
  }

  std::optional<LinkBeyond> Find() {
    std::vector<LinkBeyond> farthest = FarthestOfSample();
    std::optional<LinkBeyond> found;
    for (LinkBeyond& at : farthest) {
      if (at.q.empty()) continue;
      Climb(at);
      if (at.by > 0 && (!found || at.by > found->by)) found = std::move(at);
    }
    return found;
  }

 private:
  static constexpr int kFaces = 6;

  double Value(size_t joint, int i, int count) const {
    const GridJoint& of = moving_[joint];
    return of.lower + (of.upper - of.lower) * i / (count - 1);
  }

  // For the chain's poses in poses_.
  double Beyond(size_t link, int face) const {
    const int axis = face % 3;
    const double sign = face < 3 ? -1 : 1;
    const Eigen::RowVector3d row = sign * poses_[link].linear().row(axis);
    double most = std::numeric_limits<double>::lowest();
    for (const Ball& ball : balls_[link]) most = std::max(most, row.dot(ball.point) + ball.radius);
    return most + sign * poses_[link].translation()[axis] -
           (face < 3 ? -box_.min()[axis] : box_.max()[axis]);
  }

  // The farthest of each link and face.
  std::vector<LinkBeyond> FarthestOfSample() {
    constexpr double kConfigurations = 5000;
    const size_t joints = moving_.size();
    if (joints == 0) return {};
    const int count = std::max(2, static_cast<int>(std::pow(kConfigurations, 1.0 / joints)));
    std::vector<LinkBeyond> farthest(balls_.size() * kFaces);
    std::vector<int> at(joints, 0);
    std::vector<double> q(joints);
    for (size_t joint = 0; joint < joints;) {
      for (size_t j = 0; j < joints; ++j) q[j] = Value(j, at[j], count);
      if (!forbidden_.Between(q, q)) {
        chain_.Pose(q, poses_);
        for (size_t i = 0; i < farthest.size(); ++i) {
          const size_t link = i / kFaces;
          const int face = static_cast<int>(i % kFaces);
          if (balls_[link].empty()) continue;
          const double by = Beyond(link, face);
          if (farthest[i].q.empty() || by > farthest[i].by) farthest[i] = {link, face, by, q};
        }
      }
      for (joint = 0; joint < joints && ++at[joint] == count; ++joint) at[joint] = 0;
    }
    return farthest;
  }

  // One joint after the other to where the link is farthest beyond the face.
  void Climb(LinkBeyond& from) {
    constexpr int kValues = 65;
    for (bool farther = true; farther;) {
      const double before = from.by;
      for (size_t joint = 0; joint < moving_.size(); ++joint) {
        std::vector<double> q = from.q;
        for (int i = 0; i < kValues; ++i) {
          q[joint] = Value(joint, i, kValues);
          if (forbidden_.Between(q, q)) continue;
          chain_.Pose(q, poses_);
          const double by = Beyond(from.link, from.face);
          if (by > from.by) from = {from.link, from.face, by, q};
        }
      }
      farther = from.by > before + 1e-4;
    }
  }

  const KinematicChain chain_;
  const std::span<const GridJoint> moving_;
  const JointRegions& forbidden_;
  const Eigen::AlignedBox3d box_;
  std::vector<std::vector<Ball>> balls_;  // by link; none: no joint moves it, or it has no geometry
  std::vector<Eigen::Isometry3d> poses_;
};

}  // namespace

absl::StatusOr<std::optional<LinkBeyond>> FarthestBeyond(
    const RobotModel& robot, BodyGeometry geometry, std::span<const GridJoint> moving,
    std::span<const FixedJoint> fixed, const JointRegions& forbidden, double payload_radius,
    const Eigen::AlignedBox3d& box) {
  std::vector<std::string> names;
  for (const GridJoint& joint : moving) names.push_back(joint.name);
  ASSIGN_OR_RETURN(KinematicChain chain, robot.ChainOf(names, fixed));
  return BeyondFinder(robot, geometry, std::move(chain), moving, forbidden, payload_radius, box)
      .Find();
}

}  // namespace silhouette
