// SPDX-License-Identifier: Apache-2.0
// PlacedHull: the convex hull of points, grown by a radius, and how far it is from boxes. Part of
// the pure core.
//
// Metres. To be used by one thread at a time.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <vector>

namespace silhouette {

class PlacedHull {
 public:
  // Distances are less than the true ones by up to this, for rounding.
  static constexpr double kPrecision = 1e-5;

  // The body is where normal * point <= offset. The zero value says nothing.
  struct Plane {
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // of length 1, or 0
    double offset = 0;

    // How far a box is from it, and so from the body, at least; less than 0 if it reaches through.
    double DistanceTo(const Eigen::AlignedBox3d& box) const {
      return (normal.array() * box.min().array()).min(normal.array() * box.max().array()).sum() -
             offset;
    }
  };

  // `points`: as columns, at least one; in the frame of a link.
  PlacedHull(const Eigen::Matrix3Xd& points, double radius);

  void Place(const Eigen::Isometry3d& world_from_link) {
    pose_ = world_from_link;
    ball_centre_ = pose_ * middle_;
  }

  // The plane that touches the body on the side that `normal`, of length 1, points to.
  Plane PlaneAt(const Eigen::Vector3d& normal) const {
    return {normal, normal.dot(FarthestPoint(normal)) + radius_};
  }

  // Of a ball that holds the body.
  const Eigen::Vector3d& ball_centre() const { return ball_centre_; }
  double ball_radius() const { return ball_radius_; }

  // From the body to a box, or a value that is not below `at_most` if it is that far or farther; 0
  // if they touch. `plane`: any of this body where it is now; afterwards the one that the answer
  // follows from.
  double Distance(const Eigen::AlignedBox3d& box, double at_most, Plane& plane) const;

 private:
  static constexpr size_t kLanes = 4;
  using Four [[gnu::vector_size(32)]] = double;
  // Four points, by coordinate.
  struct alignas(32) Points {
    std::array<Four, 3> coordinates{};
  };

  // The number of the point that is farthest in a direction, which is in the link's frame.
  static size_t Farthest(const std::vector<Points>& points, const double* direction);
  // The point of the hull that is farthest in a direction.
  Eigen::Vector3d FarthestPoint(const Eigen::Vector3d& direction) const;

  std::vector<Points> points_;  // the last one is repeated
  double radius_;
  Eigen::Vector3d middle_;  // of the ball, in the link's frame
  Eigen::Vector3d ball_centre_;
  double ball_radius_ = 0;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
};

}  // namespace silhouette
