// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/inner_balls.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <optional>

namespace silhouette::cell_experiment {
namespace {

// Directions spread evenly over the sphere.
constexpr int kDirections = 200;

Eigen::Vector3d Direction(int i) {
  const double z = 1 - (2 * i + 1.0) / kDirections;
  const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0));
  const double across = std::sqrt(1 - z * z);
  return {across * std::cos(angle), across * std::sin(angle), z};
}

// normal . x <= distance.
struct HalfSpace {
  Eigen::Vector3d normal;
  double distance = 0;
};

// Where the centre of a ball of `radius` on the inner side of all faces may be, in the obstacle's
// frame.
std::vector<HalfSpace> CentresWithin(const TriangleMesh& mesh, double radius) {
  std::vector<HalfSpace> spaces;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d& corner = mesh.vertices[a];
    const Eigen::Vector3d across = (mesh.vertices[b] - corner).cross(mesh.vertices[c] - corner);
    if (across.norm() < 1e-15) continue;
    const Eigen::Vector3d normal = across.normalized();
    spaces.push_back({normal, normal.dot(corner) - radius});
  }
  return spaces;
}

// The point of all half spaces that is nearest to `point` (Dykstra's projections); nothing if they
// have none in common, or it is not found.
std::optional<Eigen::Vector3d> NearestIn(const std::vector<HalfSpace>& spaces,
                                         Eigen::Vector3d point) {
  constexpr int kRounds = 100;
  // Metres by which a ball may stick out: between the many faces of round meshes the projections
  // close in slowly.
  constexpr double kClose = 0.0005;
  std::vector<double> corrections(spaces.size());
  for (int round = 0; round < kRounds; ++round) {
    double farthest = 0;
    for (size_t i = 0; i < spaces.size(); ++i) {
      const auto& [normal, distance] = spaces[i];
      const double beyond = normal.dot(point) + corrections[i] - distance;
      farthest = std::max(farthest, normal.dot(point) - distance);
      const double correction = std::max(beyond, 0.0);
      point += (corrections[i] - correction) * normal;
      corrections[i] = correction;
    }
    if (farthest <= kClose) return point;
  }
  return std::nullopt;
}

}  // namespace

std::vector<Eigen::Vector3d> BallsWithin(const Obstacle& obstacle, const Eigen::Vector3d& point,
                                         double radius) {
  const Eigen::Isometry3d pose = obstacle.PoseAt(0);
  const Eigen::Vector3d inside = pose.inverse() * point;
  const std::vector<HalfSpace> spaces = CentresWithin(obstacle.mesh, radius);
  std::vector<Eigen::Vector3d> centres;
  const auto add = [&](const Eigen::Vector3d& from) {
    const std::optional<Eigen::Vector3d> centre = NearestIn(spaces, from);
    if (centre && (*centre - inside).norm() <= radius) centres.push_back(pose * *centre);
  };
  add(inside);
  if (centres.empty()) return centres;
  for (int i = 0; i < kDirections; i += 10) add(inside + radius * Direction(i));
  return centres;
}

std::vector<Eigen::Vector3d> PointsOfBall(const Eigen::Vector3d& centre, double radius) {
  std::vector<Eigen::Vector3d> points = {centre};
  for (int i = 0; i < kDirections; ++i) points.emplace_back(centre + radius * Direction(i));
  return points;
}

}  // namespace silhouette::cell_experiment
