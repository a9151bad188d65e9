// SPDX-License-Identifier: Apache-2.0
// Convex outlines in the plane. Outlines are counter-clockwise (x right, y up), without points
// inside an edge. Results replace what their vector held; nothing allocates once it has the room.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace silhouette {

inline double CrossOf(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Drops points that are not on the hull for certain: those inside the octagon of the points that
// are farthest out. `radii`, if there are any: of circles about the points, of whose hull it is.
// Nothing changes but how long ConvexHull takes.
void DropInner(std::vector<Eigen::Vector2d>& points, std::vector<double>& radii);

// The convex hull of `points`, at least one, which are sorted. One or two points if they are all at
// one place or on a line.
void ConvexHull(std::vector<Eigen::Vector2d>& points, std::vector<Eigen::Vector2d>& hull);

// An outline about all points within `radius` of the hull. Its corners are at most 3.5 % of the
// radius farther away.
void WidenOutline(std::span<const Eigen::Vector2d> hull, double radius,
                  std::vector<Eigen::Vector2d>& outline);

// Appends the corners of a polygon about a circle.
void AppendAround(const Eigen::Vector2d& centre, double radius,
                  std::vector<Eigen::Vector2d>& points);

}  // namespace silhouette
