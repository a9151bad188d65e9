// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/convex_hull.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <unordered_map>
#include <utility>

extern "C" {
#include <libqhull_r/qhull_ra.h>
}

namespace silhouette {
namespace {

using Eigen::Vector3d;

constexpr double kFlat = 1e-6;  // metres

// One run of Qhull, whose memory ends with it.
class QhullRun {
 public:
  // Triangulated ("Qt"). False if Qhull can make no body of the points.
  bool Compute(std::vector<double>& coordinates) {
    qh_zero(&qhull_, nullptr);
    char command[] = "qhull Qt Pp";
    const int points = static_cast<int>(coordinates.size() / 3);
    return qh_new_qhull(&qhull_, 3, points, coordinates.data(), False, command, nullptr, nullptr) ==
           0;
  }
  ~QhullRun() {
    qh_freeqhull(&qhull_, !qh_ALL);
    int current = 0;
    int total = 0;
    qh_memfreeshort(&qhull_, &current, &total);
  }
  QhullRun() = default;
  QhullRun(const QhullRun&) = delete;
  QhullRun& operator=(const QhullRun&) = delete;

  ConvexBody Body();

 private:
  qhT qhull_{};
};

ConvexBody QhullRun::Body() {
  qhT* const qh = &qhull_;
  ConvexBody body;
  std::unordered_map<unsigned, uint32_t> places;
  vertexT* vertex = nullptr;
  vertexT** vertexp = nullptr;
  FORALLvertices {
    places.emplace(vertex->id, static_cast<uint32_t>(body.vertices.size()));
    body.vertices.emplace_back(vertex->point[0], vertex->point[1], vertex->point[2]);
  }
  facetT* facet = nullptr;
  FORALLfacets {
    body.planes.push_back(
        {Vector3d(facet->normal[0], facet->normal[1], facet->normal[2]), facet->offset});
    std::array<uint32_t, 3> corners{};
    size_t count = 0;
    FOREACHvertex_(facet->vertices) {
      if (count < 3) corners[count++] = places.at(vertex->id);
    }
    if (facet->toporient != qh_ORIENTclock) std::swap(corners[1], corners[2]);
    body.triangles.push_back(corners);
  }
  qh_getarea(qh, qh->facet_list);
  body.volume = qh->totvol;
  return body;
}

// Whether the points are within kFlat of a plane.
bool IsFlat(std::span<const Vector3d> points) {
  const auto farthest = [&](const auto& distance) {
    return *std::ranges::max_element(
        points, [&](const Vector3d& a, const Vector3d& b) { return distance(a) < distance(b); });
  };
  if (points.size() < 4) return true;
  const Vector3d& a = points[0];
  const Vector3d b = farthest([&](const Vector3d& p) { return (p - a).squaredNorm(); });
  if ((b - a).norm() < kFlat) return true;
  const Vector3d along = (b - a).normalized();
  const Vector3d c = farthest([&](const Vector3d& p) { return along.cross(p - a).squaredNorm(); });
  if (along.cross(c - a).norm() < kFlat) return true;
  const Vector3d normal = along.cross(c - a).normalized();
  return std::ranges::all_of(
      points, [&](const Vector3d& p) { return std::abs(normal.dot(p - a)) < kFlat; });
}

}  // namespace

double ConvexBody::Depth(const Vector3d& point) const {
  double depth = std::numeric_limits<double>::infinity();
  for (const Plane& plane : planes)
    depth = std::min(depth, -plane.normal.dot(point) - plane.offset);
  return depth;
}

bool ConvexBody::Contains(const Vector3d& point, double slack) const {
  return std::ranges::all_of(
      planes, [&](const Plane& plane) { return plane.normal.dot(point) + plane.offset <= slack; });
}

std::optional<ConvexBody> HullOf(std::span<const Vector3d> points) {
  if (IsFlat(points)) return std::nullopt;
  std::vector<double> coordinates;
  coordinates.reserve(3 * points.size());
  for (const Vector3d& p : points) coordinates.insert(coordinates.end(), p.data(), p.data() + 3);
  QhullRun run;
  if (!run.Compute(coordinates)) return std::nullopt;
  return run.Body();
}

std::optional<ConvexBody> Shrunk(const ConvexBody& body, double depth) {
  // Seen from a point within, the plane at distance h with normal n is the point n / h of the dual
  // body, and the planes of the dual body's faces are the corners of this one.
  Vector3d within = Vector3d::Zero();
  for (const Vector3d& vertex : body.vertices) within += vertex;
  within /= static_cast<double>(body.vertices.size());
  if (!(body.Depth(within) > depth + kFlat)) return std::nullopt;
  std::vector<Vector3d> dual;
  for (const ConvexBody::Plane& plane : body.planes) {
    dual.push_back(plane.normal / (-plane.normal.dot(within) - plane.offset - depth));
  }
  const std::optional<ConvexBody> dual_body = HullOf(dual);
  if (!dual_body) return std::nullopt;
  std::vector<Vector3d> corners;
  for (const ConvexBody::Plane& plane : dual_body->planes) {
    corners.push_back(within - plane.normal / plane.offset);
  }
  return HullOf(corners);
}

}  // namespace silhouette
