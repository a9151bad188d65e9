// Triangle meshes, and the meshes of primitive shapes.
//
// All are closed, centred on the origin, with triangles counter-clockwise seen from outside. Round
// shapes are inscribed: their corners lie on the true surface.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace silhouette {

struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;           // metres
  std::vector<std::array<uint32_t, 3>> triangles;  // indices of vertices
};

// Corners of the polygon that stands for a circle.
inline constexpr int kCircleCorners = 48;

// `size`: edge lengths along x, y and z.
TriangleMesh BoxMesh(const Eigen::Vector3d& size);

// Axis along z, from -length / 2 to length / 2.
TriangleMesh CylinderMesh(double radius, double length);

TriangleMesh SphereMesh(double radius);

// A cylinder of `length` along z with a half sphere on either end: length + 2 * radius in all.
TriangleMesh CapsuleMesh(double radius, double length);

}  // namespace silhouette
