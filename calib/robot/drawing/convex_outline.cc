// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/convex_outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace silhouette {
namespace {

using Eigen::Vector2d;

// Appends the corners of a polygon about the part of a circle from the direction `from` to `to`,
// counter-clockwise by at most half a turn: where the tangents meet, no two of which are more than
// 30 degrees apart.
void AppendArc(const Vector2d& centre, double radius, const Vector2d& from, const Vector2d& to,
               std::vector<Vector2d>& points) {
  constexpr double kCos30 = 0.8660254037844386;
  if (from.dot(to) >= kCos30) {
    const Vector2d sum = from + to;
    points.emplace_back(centre + 2 * radius / sum.squaredNorm() * sum);
    return;
  }
  // Half a turn has no sum.
  const Vector2d between = from.dot(to) < -0.5
                               ? Vector2d(Vector2d(-from.y(), from.x()) + Vector2d(to.y(), -to.x()))
                               : Vector2d(from + to);
  const Vector2d middle = between.normalized();
  AppendArc(centre, radius, from, middle, points);
  AppendArc(centre, radius, middle, to, points);
}

}  // namespace

void DropInner(std::vector<Vector2d>& points, std::vector<double>& radii) {
  constexpr size_t kCorners = 8;
  if (points.size() <= kCorners) return;
  const auto values = [](const Vector2d& p) {
    return std::array<double, 4>{p.x(), p.x() + p.y(), p.y(), p.y() - p.x()};
  };
  std::array<double, 4> low = values(points.front());
  std::array<double, 4> high = low;
  for (const Vector2d& p : points) {
    const std::array<double, 4> at = values(p);
    for (size_t i = 0; i < 4; ++i) {
      low[i] = std::min(low[i], at[i]);
      high[i] = std::max(high[i], at[i]);
    }
  }
  Vector2d corners[kCorners];  // counter-clockwise
  std::fill_n(corners, kCorners, points.front());
  for (const Vector2d& p : points) {
    const std::array<double, 4> at = values(p);
    for (size_t i = 0; i < 4; ++i) {
      if (at[i] == high[i]) corners[i] = p;
      if (at[i] == low[i]) corners[i + 4] = p;
    }
  }
  Vector2d normals[kCorners];  // inwards
  Vector2d from[kCorners];  // a corner on each side: exactly 0 from it, also with fused arithmetic
  size_t sides = 0;
  for (size_t i = 0; i < kCorners; ++i) {
    const Vector2d along = corners[(i + 1) % kCorners] - corners[i];
    if (along.x() == 0 && along.y() == 0) continue;
    normals[sides] = {-along.y(), along.x()};
    from[sides] = corners[i];
    ++sides;
  }
  if (sides == 0) return;  // all points are one
  const double least = radii.empty() ? 0 : *std::ranges::min_element(radii);
  double lengths[kCorners] = {};
  for (size_t i = 0; i < sides && !radii.empty(); ++i) lengths[i] = normals[i].norm();
  size_t kept = 0;
  for (size_t at = 0; at < points.size(); ++at) {
    const Vector2d p = points[at];
    // The octagon holds circles of the least radius about all of its points.
    const double more = radii.empty() ? 0 : radii[at] - least;
    bool inside = true;
    for (size_t i = 0; i < sides; ++i) {
      inside &= normals[i].x() * (p.x() - from[i].x()) + normals[i].y() * (p.y() - from[i].y()) >
                more * lengths[i];
    }
    if (inside) continue;
    points[kept] = p;
    if (!radii.empty()) radii[kept] = radii[at];
    ++kept;
  }
  points.resize(kept);
  if (!radii.empty()) radii.resize(kept);
}

void ConvexHull(std::vector<Vector2d>& points, std::vector<Vector2d>& hull) {
  std::sort(points.begin(), points.end(), [](const Vector2d& a, const Vector2d& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  });
  hull.clear();
  const auto add = [&](const Vector2d& point, size_t least) {
    while (hull.size() >= least + 2 &&
           CrossOf(hull.back() - hull[hull.size() - 2], point - hull.back()) <= 0) {
      hull.pop_back();
    }
    if (hull.size() == least || hull.back() != point) hull.push_back(point);
  };
  for (const Vector2d& point : points) add(point, 0);
  if (hull.size() < 2) return;
  // The lower side is done; the upper one goes back from its end.
  const size_t lower = hull.size() - 1;
  for (size_t i = points.size() - 1; i-- > 0;) add(points[i], lower);
  hull.pop_back();  // the first again
}

void WidenOutline(std::span<const Vector2d> hull, double radius, std::vector<Vector2d>& outline) {
  outline.clear();
  if (radius == 0) {
    outline.assign(hull.begin(), hull.end());
    return;
  }
  if (hull.size() == 1) {
    AppendAround(hull[0], radius, outline);
    return;
  }
  const auto normal = [&](size_t edge) {
    const Vector2d along = (hull[(edge + 1) % hull.size()] - hull[edge]).normalized();
    return Vector2d(along.y(), -along.x());
  };
  Vector2d before = normal(hull.size() - 1);
  for (size_t i = 0; i < hull.size(); ++i) {
    const Vector2d after = normal(i);
    AppendArc(hull[i], radius, before, after, outline);
    before = after;
  }
}

void AppendAround(const Vector2d& centre, double radius, std::vector<Vector2d>& points) {
  // Twelve, where tangents 30 degrees apart meet.
  static const auto corners = [] {
    std::array<Vector2d, 12> around;
    for (size_t i = 0; i < around.size(); ++i) {
      const double angle = std::numbers::pi / 6 * static_cast<double>(i);
      around[i] = Vector2d(std::cos(angle), std::sin(angle)) / std::cos(std::numbers::pi / 12);
    }
    return around;
  }();
  for (const Vector2d& corner : corners) points.push_back(centre + radius * corner);
}

}  // namespace silhouette
