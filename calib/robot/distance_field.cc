// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/distance_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <stdexcept>
#include <utility>

#include "calib/robot/triangle_mesh.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;

constexpr int kBlock = 8;           // samples along the edge of those that are looked at together
constexpr double kRounding = 1e-6;  // metres: more than a float errs by

float RoundedUp(double value) {
  return std::nextafter(static_cast<float>(value), std::numeric_limits<float>::infinity());
}

// The mesh with one vertex at every place, and no triangle that uses one twice.
TriangleMesh Welded(const TriangleMesh& mesh) {
  const auto before = [](const Vector3d& a, const Vector3d& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  std::map<Vector3d, uint32_t, decltype(before)> places(before);
  TriangleMesh welded;
  std::vector<uint32_t> numbers;
  for (const Vector3d& vertex : mesh.vertices) {
    const auto [place, added] =
        places.emplace(vertex, static_cast<uint32_t>(welded.vertices.size()));
    if (added) welded.vertices.push_back(vertex);
    numbers.push_back(place->second);
  }
  for (const auto& triangle : mesh.triangles) {
    const std::array<uint32_t, 3> at = {numbers[triangle[0]], numbers[triangle[1]],
                                        numbers[triangle[2]]};
    if (at[0] != at[1] && at[1] != at[2] && at[2] != at[0]) welded.triangles.push_back(at);
  }
  return welded;
}

// Sheets that are seen from both sides: their edges cancel out, but they enclose nothing.
bool HasTwoSidedTriangle(const TriangleMesh& mesh) {
  std::set<std::array<uint32_t, 3>> sides;  // least corner first, in the order of the triangle
  for (std::array<uint32_t, 3> corners : mesh.triangles) {
    std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
    if (sides.contains({corners[0], corners[2], corners[1]})) return true;
    sides.insert(corners);
  }
  return false;
}

bool IsClosedWelded(const TriangleMesh& mesh) {
  std::map<std::pair<uint32_t, uint32_t>, int> passes;
  for (const auto& triangle : mesh.triangles) {
    for (size_t i = 0; i < 3; ++i) {
      const uint32_t a = triangle[i];
      const uint32_t b = triangle[(i + 1) % 3];
      passes[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  }
  return !mesh.triangles.empty() && !HasTwoSidedTriangle(mesh) &&
         std::ranges::all_of(passes, [](const auto& edge) { return edge.second == 0; });
}

double SignedVolume(const TriangleMesh& mesh) {
  double six_volumes = 0;
  for (const auto& triangle : mesh.triangles) {
    six_volumes += mesh.vertices[triangle[0]].dot(
        mesh.vertices[triangle[1]].cross(mesh.vertices[triangle[2]]));
  }
  return six_volumes / 6;
}

// On which side of the edge from `a` to `b` the line along x through (y, z) passes: 1 or -1; where
// it meets the edge, as if y and then z were a little greater. 0: the edge is a point to it. The
// same, but for the sign, for the edge from `b` to `a`.
int SideOf(const Vector3d& a, const Vector3d& b, double y, double z) {
  const double dy = b.y() - a.y();
  const double dz = b.z() - a.z();
  const double side = dy * (z - a.z()) - dz * (y - a.y());
  if (side != 0) return side > 0 ? 1 : -1;
  if (dz != 0) return dz < 0 ? 1 : -1;
  return dy > 0 ? 1 : dy < 0 ? -1 : 0;
}

struct Crossing {
  double x = 0;
  int turn = 0;  // 1: into the body, along x; -1: out of it
};

// Where the line along x through (y, z) crosses a triangle; turn 0: nowhere.
Crossing CrossingOf(const TriangleMesh& mesh, const std::array<uint32_t, 3>& triangle, double y,
                    double z) {
  std::array<int, 3> sides{};
  for (size_t i = 0; i < 3; ++i) {
    const uint32_t a = triangle[i];
    const uint32_t b = triangle[(i + 1) % 3];
    sides[i] = a < b ? SideOf(mesh.vertices[a], mesh.vertices[b], y, z)
                     : -SideOf(mesh.vertices[b], mesh.vertices[a], y, z);
  }
  if (sides[0] == 0 || sides[0] != sides[1] || sides[1] != sides[2]) return {};
  const Vector3d& corner = mesh.vertices[triangle[0]];
  const Vector3d normal =
      (mesh.vertices[triangle[1]] - corner).cross(mesh.vertices[triangle[2]] - corner);
  if (normal.x() == 0) return {};
  const double x =
      corner.x() - (normal.y() * (y - corner.y()) + normal.z() * (z - corner.z())) / normal.x();
  return {x, sides[0] > 0 ? -1 : 1};
}

}  // namespace

bool IsClosed(const TriangleMesh& mesh) { return IsClosedWelded(Welded(mesh)); }

std::vector<TriangleMesh> SolidsOf(const TriangleMesh& mesh) {
  const TriangleMesh welded = Welded(mesh);
  std::map<std::pair<uint32_t, uint32_t>, std::vector<size_t>> at_edge;
  std::vector<size_t> piece(welded.triangles.size());  // by triangle, towards one for all
  std::iota(piece.begin(), piece.end(), 0);
  for (size_t t = 0; t < piece.size(); ++t) {
    const auto& [a, b, c] = welded.triangles[t];
    for (const auto& edge : {std::minmax(a, b), std::minmax(b, c), std::minmax(c, a)}) {
      at_edge[edge].push_back(t);
    }
  }
  const auto piece_of = [&](size_t t) {
    while (piece[t] != t) t = piece[t] = piece[piece[t]];
    return t;
  };
  for (const auto& [edge, at] : at_edge) {
    if (at.size() == 2) piece[piece_of(at[0])] = piece_of(at[1]);  // else solids meet there
  }
  std::map<size_t, TriangleMesh> pieces;
  for (size_t t = 0; t < piece.size(); ++t) {
    TriangleMesh& of_piece = pieces[piece_of(t)];
    const auto at = static_cast<uint32_t>(of_piece.vertices.size());
    for (uint32_t vertex : welded.triangles[t]) {
      of_piece.vertices.push_back(welded.vertices[vertex]);
    }
    of_piece.triangles.push_back({at, at + 1, at + 2});
  }
  std::map<bool, TriangleMesh> solids;  // by whether the volume is positive
  for (const auto& [number, of_piece] : pieces) {
    TriangleMesh& solid = solids[SignedVolume(of_piece) > 0];
    const auto first = static_cast<uint32_t>(solid.vertices.size());
    solid.vertices.insert(solid.vertices.end(), of_piece.vertices.begin(), of_piece.vertices.end());
    for (const auto& [a, b, c] : of_piece.triangles) {
      solid.triangles.push_back({first + a, first + b, first + c});
    }
  }
  if (solids.size() == 1) return {mesh};
  if (!IsClosed(solids[false]) || !IsClosed(solids[true])) return {};
  return {solids[false], solids[true]};
}

DistanceField::DistanceField(std::span<const TriangleMesh> meshes, double range, double step)
    : step_(step) {
  if (!(range > 0) || !(step > 0) || meshes.empty()) {
    throw std::invalid_argument("a distance field needs a mesh, a range and a step");
  }
  std::vector<TriangleMesh> welded;
  for (const TriangleMesh& mesh : meshes) {
    welded.push_back(Welded(mesh));
    if (!IsClosedWelded(welded.back())) throw std::invalid_argument("a mesh is not closed");
    for (const Vector3d& vertex : mesh.vertices) box_.extend(vertex);
  }
  const Vector3d sizes = box_.sizes() + 2 * Vector3d::Constant(range);
  step_ = std::max(step_, std::cbrt(sizes.prod() / kMostSamples));
  lower_ = box_.min() - Vector3d::Constant(range);
  size_ = (sizes / step_).array().ceil().matrix().cast<int>() + Eigen::Vector3i::Ones();
  size_ = (size_.array() + (kBlock - 1)) / kBlock * kBlock;
  samples_.assign(IndexOf(0, 0, size_.z()), std::numeric_limits<float>::infinity());
  for (const TriangleMesh& mesh : welded) Take(mesh);
}

std::vector<bool> DistanceField::Enclosed(const TriangleMesh& mesh) const {
  // By row along x.
  std::vector<std::vector<Crossing>> rows(static_cast<size_t>(size_.y()) *
                                          static_cast<size_t>(size_.z()));
  const int outward = SignedVolume(mesh) > 0 ? 1 : -1;
  for (const auto& triangle : mesh.triangles) {
    Eigen::AlignedBox3d box;
    for (uint32_t vertex : triangle) box.extend(mesh.vertices[vertex]);
    const Eigen::Vector3i from =
        ((box.min() - lower_) / step_).array().floor().matrix().cast<int>();
    const Eigen::Vector3i to = ((box.max() - lower_) / step_).array().ceil().matrix().cast<int>();
    for (int z = std::max(from.z(), 0); z <= std::min(to.z(), size_.z() - 1); ++z) {
      for (int y = std::max(from.y(), 0); y <= std::min(to.y(), size_.y() - 1); ++y) {
        const Vector3d at = PointOf(0, y, z);
        Crossing crossing = CrossingOf(mesh, triangle, at.y(), at.z());
        crossing.turn *= outward;
        if (crossing.turn != 0) rows[static_cast<size_t>(z * size_.y() + y)].push_back(crossing);
      }
    }
  }
  std::vector<bool> enclosed(samples_.size(), false);
  for (size_t row = 0; row < rows.size(); ++row) {
    std::vector<Crossing>& crossings = rows[row];
    std::ranges::sort(crossings, {}, &Crossing::x);
    int turns = 0;
    for (const Crossing& crossing : crossings) turns += crossing.turn;
    if (turns != 0) continue;  // lost to rounding: nothing is known of the row
    size_t next = 0;
    for (int x = 0; x < size_.x(); ++x) {
      for (; next < crossings.size() && crossings[next].x < lower_.x() + step_ * x; ++next) {
        turns += crossings[next].turn;
      }
      enclosed[row * static_cast<size_t>(size_.x()) + static_cast<size_t>(x)] = turns > 0;
    }
  }
  return enclosed;
}

void DistanceField::Take(const TriangleMesh& mesh) {
  const MeshTree tree(mesh);
  const std::vector<bool> enclosed = Enclosed(mesh);
  uint32_t hint = 0;
  const auto distance_at = [&](int x, int y, int z) {
    const double distance = tree.Distance(PointOf(x, y, z), hint);
    return enclosed[IndexOf(x, y, z)] ? -distance : distance;
  };
  // From the block's middle to its farthest sample.
  constexpr int kMiddle = kBlock / 2;
  const double reach = std::sqrt(3.0) * kMiddle * step_;
  const auto take_block = [&](int left, int front, int bottom) {
    const Vector3d middle = PointOf(left + kMiddle, front + kMiddle, bottom + kMiddle);
    const double of_middle = distance_at(left + kMiddle, front + kMiddle, bottom + kMiddle);
    const bool deep = of_middle + 2 * reach < 0;
    for (int z = bottom; z < bottom + kBlock; ++z) {
      for (int y = front; y < front + kBlock; ++y) {
        for (int x = left; x < left + kBlock; ++x) {
          float& sample = samples_[IndexOf(x, y, z)];
          const double away = (PointOf(x, y, z) - middle).norm();
          if (of_middle - away >= sample) continue;  // another mesh is nearer
          const double distance = deep ? of_middle + away : distance_at(x, y, z);
          sample = std::min(sample, RoundedUp(distance));
        }
      }
    }
  };
  for (int z = 0; z < size_.z(); z += kBlock) {
    for (int y = 0; y < size_.y(); y += kBlock) {
      for (int x = 0; x < size_.x(); x += kBlock) take_block(x, y, z);
    }
  }
}

struct DistanceField::Near {
  // By corner, x fastest: those below, then those above. Exact to less than kRounding.
  std::array<Eigen::Array4f, 2> distances;
  std::array<Eigen::Array4f, 2> ways;  // to the point, or to the nearest one among the samples
  double way = 0;                      // from there to the point
};

DistanceField::Near DistanceField::At(const Vector3d& point) const {
  const Vector3d last = PointOf(size_.x() - 1, size_.y() - 1, size_.z() - 1);
  const Vector3d within = point.cwiseMax(lower_).cwiseMin(last);
  const Vector3d at = (within - lower_) / step_;
  const Eigen::Vector3i cell = at.cast<int>().cwiseMin(size_ - Eigen::Vector3i::Constant(2));
  const Eigen::Array3d share = (at - cell.cast<double>()).array();
  // By axis, squares of the way to either side.
  const Eigen::Array3f low = (step_ * share).square().cast<float>();
  const Eigen::Array3f high = (step_ * (1 - share)).square().cast<float>();
  const float* below = samples_.data() + IndexOf(cell.x(), cell.y(), cell.z());
  const float* above = below + IndexOf(0, 0, 1);
  const size_t on = IndexOf(0, 1, 0);
  const Eigen::Array4f in_plane(low[0] + low[1], high[0] + low[1], low[0] + high[1],
                                high[0] + high[1]);
  return {.distances = {Eigen::Array4f(below[0], below[1], below[on], below[on + 1]),
                        Eigen::Array4f(above[0], above[1], above[on], above[on + 1])},
          .ways = {(in_plane + low[2]).sqrt(), (in_plane + high[2]).sqrt()},
          .way = (point - within).norm()};
}

double DistanceField::AtMost(const Vector3d& point) const {
  // Beyond the samples it is at most as far as by way of the nearest one.
  const Near near = At(point);
  const auto from = [&](size_t side) {
    return near.distances[side].cast<double>() + near.ways[side].cast<double>();
  };
  const double least = from(0).min(from(1)).minCoeff();
  return least + kRounding + near.way;
}

double DistanceField::AtLeast(const Vector3d& point) const {
  const double to_box = std::sqrt(box_.squaredExteriorDistance(point));
  const Near near = At(point);
  if (near.way > 0) return to_box;
  // Samples deep inside tell too much, but nothing that is positive a step away.
  const auto from = [&](size_t side) {
    return near.distances[side].cast<double>() - near.ways[side].cast<double>();
  };
  const double greatest = from(0).max(from(1)).maxCoeff();
  return std::max(greatest - kRounding, to_box);
}

}  // namespace silhouette
