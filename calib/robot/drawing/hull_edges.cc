// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/hull_edges.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/robot/drawing/convex_outline.h"
#include "db/mask/wider_vectors.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Four [[gnu::vector_size(32)]] = double;
using Bits [[gnu::vector_size(32)]] = int64_t;

// Metres: places that are as near count as one, and faces that are as flat as one.
constexpr double kFlat = 1e-8;

// The least wedge of the plane, from `first` counter-clockwise to `last`, that holds directions.
struct Wedge {
  Vector2d first;
  Vector2d last;

  // False: they are in no half plane.
  bool Extend(const Vector2d& to) {
    const bool before = CrossOf(first, to) < 0;
    const bool behind = CrossOf(to, last) < 0;
    if (before && behind) return false;
    if (before) first = to;
    if (behind) last = to;
    // Opposite to the only one so far.
    if (!before && !behind && to.dot(first) < 0 && to.dot(last) < 0) last = to;
    return true;
  }
};

}  // namespace

HullEdges::HullEdges(const Eigen::Matrix3Xd& points) : points_(points.cols()) {
  if (points.cols() > kMostPoints) return;
  for (Eigen::Index a = 0; a < points.cols(); ++a) {
    for (Eigen::Index b = a + 1; b < points.cols(); ++b) Add(points, a, b);
  }
}

// Seen along an edge, all points are in a wedge whose sides are the faces that meet there.
void HullEdges::Add(const Eigen::Matrix3Xd& points, Eigen::Index a, Eigen::Index b) {
  const Vector3d from = points.col(a);
  const Vector3d along = points.col(b) - from;
  if (along.norm() < kFlat) return;
  const Vector3d right = along.unitOrthogonal();
  const Vector3d up = along.normalized().cross(right);
  std::optional<Wedge> wedge;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Vector3d off = points.col(i) - from;
    const Vector2d seen(right.dot(off), up.dot(off));
    const double length = seen.norm();
    if (length < kFlat) continue;  // on the edge, or at its ends
    if (!wedge) wedge = Wedge{seen / length, seen / length};
    if (!wedge->Extend(seen / length)) return;
  }
  std::array<Eigen::Vector4d, 2> planes = {Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
  if (wedge) {
    const auto& [first, last] = *wedge;
    // Both faces are in one plane.
    if (first.dot(last) < 0 && CrossOf(first, last) < kFlat) return;
    const Vector3d normals[2] = {first.y() * right - first.x() * up,
                                 last.x() * up - last.y() * right};
    for (size_t face = 0; face < 2; ++face) {
      planes[face] << normals[face], -normals[face].dot(from);
    }
  }
  const size_t lane = edges_.size() % kLanes;
  edges_.push_back({static_cast<uint32_t>(a), static_cast<uint32_t>(b)});
  if (lane == 0) faces_.emplace_back();
  for (size_t face = 0; face < 2; ++face) {
    for (size_t i = 0; i < 4; ++i) {
      faces_.back().planes[face][i][lane] = planes[face][static_cast<Eigen::Index>(i)];
    }
  }
}

double HullEdges::DepthOf(const Vector3d& point) const {
  constexpr double kDoubt = 1e-6;  // metres: faces that are nearly one are taken for one
  double least = std::numeric_limits<double>::infinity();
  for (size_t edge = 0; edge < edges_.size(); ++edge) {
    for (const auto& plane : faces_[edge / kLanes].planes) {
      const auto of_edge = [&](size_t i) { return plane[i][edge % kLanes]; };
      const Vector3d normal(of_edge(0), of_edge(1), of_edge(2));
      least = std::min(least, -(normal.dot(point) + of_edge(3)));
    }
  }
  return edges_.empty() ? 0 : std::max(0.0, least - kDoubt);
}

SILHOUETTE_WIDER_VECTORS static uint32_t EdgesBetween(const Four* a, const Four* b,
                                                      const double* eye) {
  const double doubt = 10 * kFlat * (1 + std::abs(eye[0]) + std::abs(eye[1]) + std::abs(eye[2]));
  const Four of_a = a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2] + a[3];
  const Four of_b = b[0] * eye[0] + b[1] * eye[1] + b[2] * eye[2] + b[3];
  const Bits lanes = {1, 2, 4, 8};
  const Bits both_seen = (of_a > doubt) & (of_b > doubt);
  const Bits both_hidden = (of_a < -doubt) & (of_b < -doubt);
  const Bits between = ~(both_seen | both_hidden) & lanes;
  return static_cast<uint32_t>(between[0] | between[1] | between[2] | between[3]);
}

uint32_t HullEdges::OutlineOf(const Faces& faces, const Vector3d& eye) {
  return EdgesBetween(faces.planes[0].data(), faces.planes[1].data(), eye.data());
}

}  // namespace silhouette
