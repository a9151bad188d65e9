// SPDX-License-Identifier: Apache-2.0
// ConvexBody: the convex hull of points in space, by Qhull.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace silhouette {

struct ConvexBody {
  // normal * point + offset <= 0 within; unit normals.
  struct Plane {
    Eigen::Vector3d normal;
    double offset;
  };

  std::vector<Eigen::Vector3d> vertices;
  std::vector<Plane> planes;
  // Of its surface, counter-clockwise seen from outside.
  std::vector<std::array<uint32_t, 3>> triangles;
  double volume = 0;

  // How deep inside a point is: the distance from the nearest face's plane; negative outside.
  double Depth(const Eigen::Vector3d& point) const;
  // Whether a point is outside no face's plane by more than `slack`.
  bool Contains(const Eigen::Vector3d& point, double slack) const;
};

// Nothing if the points are in a plane, on a line or one, to a micrometre. All are finite.
std::optional<ConvexBody> HullOf(std::span<const Eigen::Vector3d> points);

// What remains of a body if all of its faces move inward by `depth`; nothing if nothing does.
std::optional<ConvexBody> Shrunk(const ConvexBody& body, double depth);

}  // namespace silhouette
