#include "calib/robot/mesh_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace silhouette {
namespace {

using Eigen::Vector3d;

constexpr uint32_t kLeaf = 4;  // triangles

Vector3d NearestOnEdge(const Vector3d& a, const Vector3d& b, const Vector3d& point) {
  const Vector3d along = b - a;
  const double length = along.squaredNorm();
  if (!(length > 0)) return a;
  return a + std::clamp((point - a).dot(along) / length, 0.0, 1.0) * along;
}

}  // namespace

// The square of the distance, or anything not below `least` if that is not below it.
double MeshTree::Triangle::SquaredDistance(const Vector3d& point, double least) const {
  const double height = normal.dot(point - corners[0]);
  if (height * height >= least) return least;  // the plane is no nearer
  bool above = !normal.isZero(0);
  double squared = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < 3; ++i) {
    const Vector3d& a = corners[i];
    const Vector3d& b = corners[(i + 1) % 3];
    if (normal.cross(b - a).dot(point - a) < 0) above = false;
    squared = std::min(squared, (NearestOnEdge(a, b, point) - point).squaredNorm());
  }
  return above ? std::min(squared, height * height) : squared;
}

MeshTree::MeshTree(const TriangleMesh& mesh) {
  for (const auto& triangle : mesh.triangles) {
    const Vector3d& a = mesh.vertices[triangle[0]];
    const Vector3d& b = mesh.vertices[triangle[1]];
    const Vector3d& c = mesh.vertices[triangle[2]];
    const Vector3d normal = (b - a).cross(c - a);
    const double length = normal.norm();
    triangles_.push_back({{a, b, c}, length > 0 ? Vector3d(normal / length) : Vector3d::Zero()});
  }
  if (!triangles_.empty()) Build(0, static_cast<uint32_t>(triangles_.size()));
}

void MeshTree::Build(uint32_t first, uint32_t count) {
  const size_t node = nodes_.size();
  nodes_.emplace_back();
  for (uint32_t i = first; i < first + count; ++i) {
    for (const Vector3d& corner : triangles_[i].corners) nodes_[node].box.extend(corner);
  }
  if (count <= kLeaf) {
    nodes_[node].first = first;
    nodes_[node].count = count;
    return;
  }
  int axis = 0;
  nodes_[node].box.sizes().maxCoeff(&axis);
  const auto place = [axis](const Triangle& triangle) {
    const auto& corners = triangle.corners;
    return corners[0][axis] + corners[1][axis] + corners[2][axis];
  };
  const auto begin = triangles_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count,
                   [&](const Triangle& a, const Triangle& b) { return place(a) < place(b); });
  Build(first, count / 2);
  nodes_[node].right = static_cast<uint32_t>(nodes_.size());
  Build(first + count / 2, count - count / 2);
}

void MeshTree::Search(uint32_t node, const Vector3d& point, double& least,
                      uint32_t& nearest) const {
  const Node& at = nodes_[node];
  for (uint32_t i = at.first; i < at.first + at.count; ++i) {
    const double distance = triangles_[i].SquaredDistance(point, least);
    if (distance >= least) continue;
    least = distance;
    nearest = i;
  }
  if (at.count > 0) return;
  std::array<uint32_t, 2> children = {node + 1, at.right};
  std::array<double, 2> away = {nodes_[children[0]].box.squaredExteriorDistance(point),
                                nodes_[children[1]].box.squaredExteriorDistance(point)};
  if (away[1] < away[0]) {
    std::swap(children[0], children[1]);
    std::swap(away[0], away[1]);
  }
  for (size_t i = 0; i < 2; ++i) {
    if (away[i] < least) Search(children[i], point, least, nearest);
  }
}

double MeshTree::Distance(const Vector3d& point, uint32_t& hint) const {
  if (triangles_.empty()) return std::numeric_limits<double>::infinity();
  double least = triangles_[hint].SquaredDistance(point, std::numeric_limits<double>::infinity());
  Search(0, point, least, hint);
  return std::sqrt(least);
}

}  // namespace silhouette
