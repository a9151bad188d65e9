#include "calib/robot/triangle_mesh.h"

#include <cmath>
#include <numbers>
#include <utility>

namespace silhouette {
namespace {

// A circle of a solid of revolution about z.
struct Ring {
  double radius;
  double z;
};

// The solid between two poles on the z axis, with `rings` from the lower pole to the upper.
TriangleMesh Revolve(double lower_pole, const std::vector<Ring>& rings, double upper_pole) {
  TriangleMesh mesh;
  mesh.vertices.emplace_back(0, 0, lower_pole);
  for (const Ring& ring : rings) {
    for (int i = 0; i < kCircleCorners; ++i) {
      const double angle = 2 * std::numbers::pi * i / kCircleCorners;
      mesh.vertices.emplace_back(ring.radius * std::cos(angle), ring.radius * std::sin(angle),
                                 ring.z);
    }
  }
  mesh.vertices.emplace_back(0, 0, upper_pole);

  const auto corner = [](size_t ring, int i) {
    return static_cast<uint32_t>(1 + ring * kCircleCorners +
                                 static_cast<size_t>(i % kCircleCorners));
  };
  const auto last = static_cast<uint32_t>(mesh.vertices.size() - 1);
  for (int i = 0; i < kCircleCorners; ++i) {
    mesh.triangles.push_back({0, corner(0, i + 1), corner(0, i)});
    for (size_t ring = 0; ring + 1 < rings.size(); ++ring) {
      mesh.triangles.push_back({corner(ring, i), corner(ring, i + 1), corner(ring + 1, i + 1)});
      mesh.triangles.push_back({corner(ring, i), corner(ring + 1, i + 1), corner(ring + 1, i)});
    }
    mesh.triangles.push_back({last, corner(rings.size() - 1, i), corner(rings.size() - 1, i + 1)});
  }
  return mesh;
}

}  // namespace

TriangleMesh BoxMesh(const Eigen::Vector3d& size) {
  TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d side((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                               (corner & 4) != 0 ? 1 : -1);
    mesh.vertices.push_back(0.5 * side.cwiseProduct(size));
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

TriangleMesh CylinderMesh(double radius, double length) {
  const double half = length / 2;
  return Revolve(-half, {{radius, -half}, {radius, half}}, half);
}

TriangleMesh SphereMesh(double radius) { return CapsuleMesh(radius, 0); }

TriangleMesh CapsuleMesh(double radius, double length) {
  constexpr int kHalfRings = kCircleCorners / 4;
  std::vector<Ring> rings;
  for (int side : {-1, 1}) {
    for (int i = 1; i <= kHalfRings; ++i) {
      // From pole to equator below, from equator to pole above.
      const double latitude =
          std::numbers::pi / 2 * (side < 0 ? i - kHalfRings : i - 1) / kHalfRings;
      if (length == 0 && side > 0 && i == 1) continue;  // one equator, not two
      rings.push_back(
          {radius * std::cos(latitude), side * length / 2 + radius * std::sin(latitude)});
    }
  }
  return Revolve(-length / 2 - radius, rings, length / 2 + radius);
}

}  // namespace silhouette
