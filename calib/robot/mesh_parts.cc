// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/mesh_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <queue>
#include <span>
#include <utility>

namespace silhouette {
namespace {

using Eigen::Vector3d;
using Corners = std::array<Vector3d, 3>;

constexpr double kSameFace = 1e-5;  // metres: nearer to a hull is as good as in it

struct LessByCoordinates {
  bool operator()(const Vector3d& a, const Vector3d& b) const {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  }
};

// A piece of the mesh and its hull; the hull is flat for no piece.
struct Piece {
  std::vector<Corners> triangles;
  ConvexBody hull;
  std::vector<uint32_t> hints;  // MeshTree::Distance's of the hull's triangles, if asked before
};

std::vector<Vector3d> PointsOfPiece(std::span<const Corners> triangles) {
  std::vector<Vector3d> points;
  for (const Corners& corners : triangles)
    points.insert(points.end(), corners.begin(), corners.end());
  // Triangles share corners, about six to one; a hull takes as much less time without.
  std::ranges::sort(points, LessByCoordinates());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  return points;
}

// Appends the part of a triangle where `side` of a point is not negative, as triangles.
template <typename Side>
void Clip(const Corners& corners, const Side& side, std::vector<Corners>& kept) {
  std::vector<Vector3d> polygon;
  for (size_t i = 0; i < 3; ++i) {
    const Vector3d& from = corners[i];
    const Vector3d& to = corners[(i + 1) % 3];
    const double before = side(from);
    const double after = side(to);
    if (before >= 0) polygon.push_back(from);
    if ((before < 0 && after > 0) || (before > 0 && after < 0)) {
      polygon.push_back(from + before / (before - after) * (to - from));
    }
  }
  for (size_t i = 2; i < polygon.size(); ++i)
    kept.push_back({polygon[0], polygon[i - 1], polygon[i]});
}

// The two pieces on either side of a plane across an axis; nothing if one of them is flat.
std::optional<std::pair<Piece, Piece>> CutAt(const Piece& piece, int axis, double place) {
  std::pair<Piece, Piece> cut;
  for (const Corners& corners : piece.triangles) {
    Clip(
        corners, [&](const Vector3d& p) { return place - p[axis]; }, cut.first.triangles);
    Clip(
        corners, [&](const Vector3d& p) { return p[axis] - place; }, cut.second.triangles);
  }
  for (Piece* side : {&cut.first, &cut.second}) {
    std::optional<ConvexBody> hull = HullOf(PointsOfPiece(side->triangles));
    if (!hull) return std::nullopt;
    side->hull = *std::move(hull);
  }
  return cut;
}

// The cut that leaves the least volume; among cuts alike, one near the middle of a long side: that
// of a ring leaves its hole until the next.
std::optional<std::pair<Piece, Piece>> BestCut(const Piece& piece) {
  constexpr int kPlaces = 4;
  constexpr double kAlike = 0.03;
  Eigen::AlignedBox3d box;
  for (const Vector3d& vertex : piece.hull.vertices) box.extend(vertex);
  std::optional<std::pair<Piece, Piece>> best;
  double least = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double shorter = 1 - box.sizes()[axis] / box.sizes().maxCoeff();
    for (int place = 1; place < kPlaces; ++place) {
      auto cut = CutAt(piece, axis, box.min()[axis] + box.sizes()[axis] * place / kPlaces);
      if (!cut) continue;
      const double off_middle = std::abs(2.0 * place / kPlaces - 1);
      const double volume = cut->first.hull.volume + cut->second.hull.volume;
      const double cost = volume * (1 + kAlike * (shorter + off_middle));
      if (best && cost >= least) continue;
      best = std::move(cut);
      least = cost;
    }
  }
  return best;
}

// The mesh and, over each of its holes, a fan from the middle of the hole's rim. Where rims meet in
// a point, it is as good as any.
TriangleMesh WithoutHoles(const TriangleMesh& mesh) {
  // Vertices at one place are one.
  std::map<Vector3d, uint32_t, LessByCoordinates> places;
  TriangleMesh closed;
  for (const Vector3d& vertex : mesh.vertices) {
    if (places.emplace(vertex, static_cast<uint32_t>(closed.vertices.size())).second) {
      closed.vertices.push_back(vertex);
    }
  }
  std::map<std::pair<uint32_t, uint32_t>, int> passes;
  for (const auto& triangle : mesh.triangles) {
    std::array<uint32_t, 3> corners{};
    for (size_t i = 0; i < 3; ++i) corners[i] = places.at(mesh.vertices[triangle[i]]);
    closed.triangles.push_back(corners);
    for (size_t i = 0; i < 3; ++i) {
      const uint32_t a = corners[i];
      const uint32_t b = corners[(i + 1) % 3];
      passes[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  }
  std::multimap<uint32_t, uint32_t> rim;
  for (const auto& [edge, times] : passes) {
    if (times > 0) rim.emplace(edge.second, edge.first);
    if (times < 0) rim.emplace(edge.first, edge.second);
  }
  while (!rim.empty()) {
    std::vector<uint32_t> loop;
    for (auto at = rim.begin(); at != rim.end(); at = rim.find(loop.back())) {
      if (loop.empty()) loop.push_back(at->first);
      loop.push_back(at->second);
      rim.erase(at);
    }
    Vector3d middle = Vector3d::Zero();
    for (const uint32_t corner : loop) middle += closed.vertices[corner];
    const auto hub = static_cast<uint32_t>(closed.vertices.size());
    closed.vertices.emplace_back(middle / static_cast<double>(loop.size()));
    for (size_t i = 1; i < loop.size(); ++i)
      closed.triangles.push_back({loop[i - 1], loop[i], hub});
  }
  return closed;
}

// What is added where: an upper bound, and the piece.
struct Excess {
  double bound = 0;
  size_t piece = 0;
};

// A triangle of a piece's hull, or a part of it.
struct Patch {
  double bound;  // no point of it is farther from the mesh
  size_t piece;
  Corners corners;
  uint32_t hint;
  bool operator<(const Patch& other) const { return bound < other.bound; }
};

// Whether all of it is within the hull of another piece.
bool IsInAnother(const Patch& patch, std::span<const Piece> pieces) {
  for (size_t i = 0; i < pieces.size(); ++i) {
    if (i == patch.piece) continue;
    const auto inside = [&](const Vector3d& p) { return pieces[i].hull.Contains(p, kSameFace); };
    if (std::ranges::all_of(patch.corners, inside)) return true;
  }
  return false;
}

// Cut across the longest side.
std::pair<Corners, Corners> Halves(const Corners& corners) {
  size_t longest = 0;
  double length = -1;
  for (size_t i = 0; i < 3; ++i) {
    const double side = (corners[(i + 1) % 3] - corners[i]).norm();
    if (side > length) {
      length = side;
      longest = i;
    }
  }
  const Vector3d& a = corners[longest];
  const Vector3d& b = corners[(longest + 1) % 3];
  const Vector3d& c = corners[(longest + 2) % 3];
  const Vector3d middle = (a + b) / 2;
  return {{a, middle, c}, {middle, b, c}};
}

// The greatest distance from the mesh of any point of the hulls' common surface, by branch and
// bound: no point of a patch is farther from the mesh than its middle is, plus its own extent, nor
// than its corners are from one triangle. The bound is exact enough to tell whether the distance is
// above `aim`; above it, it is at most 5 % too large.
Excess ExcessOf(std::span<Piece> pieces, const MeshTree& mesh, double aim) {
  std::priority_queue<Patch> patches;
  double least = 0;
  const auto add = [&](size_t piece, const Corners& corners, uint32_t& hint) {
    Patch patch{0, piece, corners, hint};
    const Vector3d middle = (corners[0] + corners[1] + corners[2]) / 3;
    double extent = 0;
    for (const Vector3d& corner : corners) extent = std::max(extent, (corner - middle).norm());
    const double distance = mesh.Distance(middle, hint);
    patch.hint = hint;
    // The distance from one triangle is convex: greatest at a corner.
    double from_nearest = 0;
    for (const Vector3d& corner : corners) {
      from_nearest = std::max(from_nearest, mesh.DistanceFrom(patch.hint, corner));
    }
    patch.bound = std::min(distance + extent, from_nearest);
    if (patch.bound <= least || IsInAnother(patch, pieces)) return;
    // The middle is on the common surface if it is in no other hull.
    const bool shown = distance > least && std::ranges::none_of(pieces, [&](const Piece& other) {
                         return &other != &pieces[piece] && other.hull.Contains(middle, kSameFace);
                       });
    if (shown) least = distance;
    patches.push(std::move(patch));
  };
  for (size_t i = 0; i < pieces.size(); ++i) {
    const ConvexBody& hull = pieces[i].hull;
    pieces[i].hints.resize(hull.triangles.size());
    for (size_t k = 0; k < hull.triangles.size(); ++k) {
      const auto& [a, b, c] = hull.triangles[k];
      add(i, {hull.vertices[a], hull.vertices[b], hull.vertices[c]}, pieces[i].hints[k]);
    }
  }
  while (!patches.empty()) {
    const Patch patch = patches.top();
    const bool close = patch.bound <= least + aim / 4 && (patch.bound <= aim || least > aim);
    if (close || patch.bound <= 1.05 * least) return {patch.bound, patch.piece};
    patches.pop();
    const auto [first, second] = Halves(patch.corners);
    uint32_t hint = patch.hint;
    add(patch.piece, first, hint);
    add(patch.piece, second, hint);
  }
  return {least, 0};
}

}  // namespace

MeshPieces PiecesOf(const TriangleMesh& mesh, double most_excess, size_t most_parts) {
  const MeshTree tree(WithoutHoles(mesh));
  std::vector<Piece> pieces(1);
  for (const auto& [a, b, c] : mesh.triangles) {
    pieces[0].triangles.push_back({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
  }
  auto hull = HullOf(PointsOfPiece(pieces[0].triangles));
  if (!hull) return {};
  pieces[0].hull = *std::move(hull);
  Excess excess = ExcessOf(pieces, tree, most_excess);
  MeshPieces best;
  const auto keep = [&] {
    best.excess = excess.bound;
    best.hulls.clear();
    for (const Piece& piece : pieces) best.hulls.push_back(piece.hull);
  };
  keep();
  constexpr size_t kPatience = 6;
  while (best.excess > most_excess &&
         pieces.size() < std::min(most_parts, best.hulls.size() + kPatience)) {
    auto cut = BestCut(pieces[excess.piece]);
    if (!cut) break;
    pieces[excess.piece] = std::move(cut->first);
    pieces.push_back(std::move(cut->second));
    excess = ExcessOf(pieces, tree, most_excess);
    // More parts cost time: less than a tenth is no gain.
    if (excess.bound < 0.9 * best.excess) keep();
  }
  return best;
}

FewPoints FewPointsOf(const ConvexBody& body, double most_radius, size_t most_points) {
  constexpr size_t kFew = 32;
  if (body.vertices.size() <= kFew) return {body.vertices, 0};
  std::vector<bool> taken(body.vertices.size(), false);
  FewPoints few;
  const auto take = [&](size_t i) {
    if (taken[i]) return;
    taken[i] = true;
    few.points.push_back(body.vertices[i]);
  };
  for (int i = 0; i < 27; ++i) {
    const Vector3d along(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    const auto less = [&](const Vector3d& p, const Vector3d& q) {
      return along.dot(p) < along.dot(q);
    };
    take(
        static_cast<size_t>(std::ranges::max_element(body.vertices, less) - body.vertices.begin()));
  }
  for (;;) {
    const std::optional<ConvexBody> hull = HullOf(few.points);
    if (!hull) return {body.vertices, 0};
    const MeshTree tree({hull->vertices, {hull->triangles.begin(), hull->triangles.end()}});
    few.radius = 0;
    uint32_t hint = 0;
    for (const Vector3d& vertex : body.vertices) {
      if (!hull->Contains(vertex, 0))
        few.radius = std::max(few.radius, tree.Distance(vertex, hint));
    }
    if (few.radius <= most_radius || few.points.size() >= most_points) break;
    // Those farthest outside, one above a face.
    std::vector<std::pair<double, size_t>> outside;
    for (const ConvexBody::Plane& plane : hull->planes) {
      std::pair<double, size_t> farthest;
      for (size_t i = 0; i < body.vertices.size(); ++i) {
        const double above = plane.normal.dot(body.vertices[i]) + plane.offset;
        if (!taken[i]) farthest = std::max(farthest, {above, i});
      }
      if (farthest.first > 0) outside.push_back(farthest);
    }
    if (outside.empty()) break;
    std::ranges::sort(outside, std::greater<>());
    constexpr size_t kARound = 8;
    outside.resize(std::min({outside.size(), kARound, most_points - few.points.size()}));
    for (const auto& [above, i] : outside) take(i);
  }
  return few;
}

double DepthOfSurface(const TriangleMesh& mesh, const ConvexBody& hull) {
  double depth = 0;
  for (const auto& triangle : mesh.triangles) {
    // No point of the triangle is deeper below a face's plane than its deepest corner.
    double of_triangle = std::numeric_limits<double>::infinity();
    for (const ConvexBody::Plane& plane : hull.planes) {
      double below = -std::numeric_limits<double>::infinity();
      for (const uint32_t corner : triangle) {
        below = std::max(below, -plane.normal.dot(mesh.vertices[corner]) - plane.offset);
      }
      of_triangle = std::min(of_triangle, below);
      if (of_triangle <= depth) break;
    }
    depth = std::max(depth, of_triangle);
  }
  return depth;
}

bool Encloses(const TriangleMesh& mesh, const Vector3d& point) {
  // The solid angle of all triangles (van Oosterom and Strackee 1983): 0 outside, a multiple of 4
  // pi within.
  double angle = 0;
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = (mesh.vertices[triangle[0]] - point).normalized();
    const Vector3d b = (mesh.vertices[triangle[1]] - point).normalized();
    const Vector3d c = (mesh.vertices[triangle[2]] - point).normalized();
    angle += 2 * std::atan2(a.dot(b.cross(c)), 1 + a.dot(b) + b.dot(c) + c.dot(a));
  }
  return std::abs(angle) > 2 * std::numbers::pi;
}

}  // namespace silhouette
