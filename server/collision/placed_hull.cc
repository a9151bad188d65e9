// SPDX-License-Identifier: Apache-2.0
#include "server/collision/placed_hull.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "db/mask/wider_vectors.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;

// The point nearest to the origin in the hull of points that are added one after another, of which
// those are kept that it is between (Wolfe 1976, "Finding the nearest point in a polytope").
class NearestPoint {
 public:
  explicit NearestPoint(const Vector3d& first) : count_(1), at_(first) {
    points_.col(0) = first;
    shares_[0] = 1;
  }

  const Vector3d& at() const { return at_; }

  // False: rounding permits none that is nearer.
  bool Add(const Vector3d& point) {
    if (count_ == kMost) return false;
    points_.col(count_) = point;
    shares_[count_] = 0;
    ++count_;
    while (true) {
      const Shares nearest = NearestInFlat();
      if (!nearest.allFinite()) return false;
      // As far as the hull reaches.
      double way = 1;
      for (Eigen::Index i = 0; i < count_; ++i) {
        if (nearest[i] < 0) way = std::min(way, shares_[i] / (shares_[i] - nearest[i]));
      }
      shares_.head(count_) += way * (nearest - shares_.head(count_));
      if (way == 1) break;
      const Eigen::Index before = count_;
      Drop();
      if (count_ == before) return false;
    }
    at_ = points_.leftCols(count_) * shares_.head(count_);
    return true;
  }

 private:
  static constexpr Eigen::Index kMost = 4;
  using Shares = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;

  // Of the point nearest to the origin in the line, plane or space of all points.
  Shares NearestInFlat() const {
    const Eigen::Index others = count_ - 1;
    Shares shares(count_);
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> edges(3, others);
    for (Eigen::Index i = 0; i < others; ++i) edges.col(i) = points_.col(i + 1) - points_.col(0);
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> products =
        edges.transpose() * edges;
    shares.tail(others) = products.ldlt().solve(-edges.transpose() * points_.col(0));
    shares[0] = 1 - shares.tail(others).sum();
    return shares;
  }

  // Points without a share.
  void Drop() {
    constexpr double kNone = 1e-12;
    Eigen::Index kept = 0;
    for (Eigen::Index i = 0; i < count_; ++i) {
      if (shares_[i] <= kNone) continue;
      points_.col(kept) = points_.col(i);
      shares_[kept] = shares_[i];
      ++kept;
    }
    count_ = kept;
  }

  Eigen::Matrix<double, 3, kMost> points_;
  Eigen::Matrix<double, kMost, 1> shares_;
  Eigen::Index count_;
  Vector3d at_;
};

// The corner that is farthest against a direction.
Vector3d CornerAgainst(const Eigen::AlignedBox3d& box, const Vector3d& direction) {
  return (direction.array() > 0).select(box.min(), box.max());
}

}  // namespace

PlacedHull::PlacedHull(const Eigen::Matrix3Xd& points, double radius)
    : points_((static_cast<size_t>(points.cols()) + kLanes - 1) / kLanes),
      radius_(radius),
      middle_((points.rowwise().minCoeff() + points.rowwise().maxCoeff()) / 2),
      ball_centre_(middle_) {
  for (size_t i = 0; i < kLanes * points_.size(); ++i) {
    const Vector3d point = points.col(std::min(static_cast<Eigen::Index>(i), points.cols() - 1));
    ball_radius_ = std::max(ball_radius_, (point - middle_).norm());
    for (size_t axis = 0; axis < 3; ++axis) {
      points_[i / kLanes].coordinates[axis][i % kLanes] = point[static_cast<Eigen::Index>(axis)];
    }
  }
  ball_radius_ += radius + kPrecision;
}

SILHOUETTE_WIDER_VECTORS size_t PlacedHull::Farthest(const std::vector<Points>& points,
                                                     const double* direction) {
  using Numbers [[gnu::vector_size(32)]] = int64_t;
  Four most = {};
  most -= std::numeric_limits<double>::infinity();
  Numbers at = {};
  for (size_t i = 0; i < points.size(); ++i) {
    const auto& [x, y, z] = points[i].coordinates;
    const Four along = x * direction[0] + y * direction[1] + z * direction[2];
    const Numbers farther = along > most;
    most = farther ? along : most;
    at = farther ? Numbers{} + static_cast<int64_t>(i) : at;
  }
  size_t best = 0;
  for (size_t lane = 1; lane < kLanes; ++lane) {
    if (most[lane] > most[best]) best = lane;
  }
  return kLanes * static_cast<size_t>(at[best]) + best;
}

Vector3d PlacedHull::FarthestPoint(const Vector3d& direction) const {
  const Vector3d in_link = pose_.linear().transpose() * direction;
  const size_t point = Farthest(points_, in_link.data());
  const auto& [x, y, z] = points_[point / kLanes].coordinates;
  return pose_ * Vector3d(x[point % kLanes], y[point % kLanes], z[point % kLanes]);
}

double PlacedHull::Distance(const Eigen::AlignedBox3d& box, double at_most, Plane& plane) const {
  constexpr int kSteps = 30;
  double proven = plane.DistanceTo(box);
  if (proven >= at_most) return proven;
  const Vector3d towards = ball_centre_.cwiseMax(box.min()).cwiseMin(box.max()) - ball_centre_;
  // From points of the box to points of the hull.
  NearestPoint apart(FarthestPoint(towards) - CornerAgainst(box, towards));
  for (int step = 0; step < kSteps; ++step) {
    const double hull_apart = apart.at().norm();  // at most
    if (hull_apart <= radius_ + kPrecision) return 0;
    const Vector3d normal = -apart.at() / hull_apart;
    const Vector3d point = FarthestPoint(normal);
    const Plane next{normal, normal.dot(point) + radius_};
    const double distance = next.DistanceTo(box);
    if (distance > proven) {
      proven = distance;
      plane = next;
    }
    if (proven >= at_most || hull_apart - radius_ - proven <= kPrecision) break;
    if (!apart.Add(point - CornerAgainst(box, normal))) break;
  }
  return std::max(0.0, proven);
}

}  // namespace silhouette
