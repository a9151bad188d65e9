// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/hull_distance.h"

#include <Eigen/QR>
#include <algorithm>
#include <bit>

namespace silhouette {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr double kExactly = 1e-7;  // metres
constexpr int kMostSteps = 100;

// Up to four points.
struct Simplex {
  Eigen::Matrix<double, 3, 4> points = Eigen::Matrix<double, 3, 4>::Zero();
  int size = 0;
};

// The point of the simplex that is nearest to the origin; leaves only the points that span it. The
// newest is one of them wherever GJK has not ended.
Vector3d Nearest(Simplex& simplex) {
  const Simplex all = simplex;
  const Vector3d newest = all.points.col(all.size - 1);
  Vector3d nearest = newest;
  simplex = Simplex();
  simplex.points.col(simplex.size++) = newest;
  for (unsigned others = 1; others < 1U << (all.size - 1); ++others) {
    Simplex some;
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> edges(3, std::popcount(others));
    for (int i = 0; i < all.size - 1; ++i) {
      if ((others >> i & 1U) == 0) continue;
      edges.col(some.size) = all.points.col(i) - newest;
      some.points.col(some.size++) = all.points.col(i);
    }
    some.points.col(some.size++) = newest;
    // The nearest point of their plane is in the simplex if no share is negative.
    const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1> shares =
        edges.colPivHouseholderQr().solve(-newest);
    if (!(shares.minCoeff() >= 0) || !(shares.sum() <= 1)) continue;
    const Vector3d point = newest + edges * shares;
    if (point.squaredNorm() >= nearest.squaredNorm()) continue;
    nearest = point;
    simplex = some;
  }
  return nearest;
}

}  // namespace

double HullDistance(const Matrix3Xd& a, const Eigen::Isometry3d& base_from_a, const Matrix3Xd& b,
                    const Eigen::Isometry3d& base_from_b, double enough) {
  const Eigen::Isometry3d a_from_b = base_from_a.inverse() * base_from_b;
  // The difference of two points, one of each hull, that is least along `towards`.
  const auto least = [&](const Vector3d& towards) -> Vector3d {
    Eigen::Index of_a = 0;
    Eigen::Index of_b = 0;
    (towards.transpose() * a).minCoeff(&of_a);
    (towards.transpose() * a_from_b.linear() * b).maxCoeff(&of_b);
    return a.col(of_a) - a_from_b * b.col(of_b);
  };
  Vector3d nearest = a.col(0) - a_from_b * b.col(0);
  Simplex simplex;
  simplex.points.col(simplex.size++) = nearest;
  double certain = 0;
  for (int i = 0; i < kMostSteps; ++i) {
    const double distance = nearest.norm();
    if (distance <= certain + kExactly) break;
    const Vector3d next = least(nearest);
    certain = std::max(certain, nearest.dot(next) / distance);
    if (certain >= enough) return enough;
    if (distance <= certain + kExactly || simplex.size == 4) break;
    simplex.points.col(simplex.size++) = next;
    nearest = Nearest(simplex);
    if (nearest.norm() >= distance) break;  // rounding
  }
  return certain;
}

}  // namespace silhouette
