// SPDX-License-Identifier: Apache-2.0
// Triangle meshes, and the meshes of primitive shapes.
//
// All are closed, centred on the origin, with triangles counter-clockwise seen from outside. Round
// shapes are inscribed: their corners lie on the true surface.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

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

// Reading meshes from files: STL, OBJ, Collada, PLY and whatever else assimp knows.

// All triangles of a file in the file's own frame, in metres; a Collada file's unit counts, its up
// axis does not (as with other readers of URDF). `scale` multiplies x, y and z.
// NotFound: no such file. InvalidArgument: not a mesh, or one without triangles.
absl::StatusOr<TriangleMesh> LoadMesh(const std::string& path, const Eigen::Vector3d& scale);

// MeshTree: how far a point is from the surface of a triangle mesh.

// A tree of boxes over the triangles. Cannot be changed once made; used by any number of threads.
class MeshTree {
 public:
  explicit MeshTree(const TriangleMesh& mesh);

  // The distance of `point` from the nearest triangle; infinity if there is none. `hint`: a
  // triangle that may be near, by its place in the tree; on return the nearest one's. 0 to begin
  // with.
  double Distance(const Eigen::Vector3d& point, uint32_t& hint) const;

  // The distance of `point` from one triangle, by its place in the tree.
  double DistanceFrom(uint32_t triangle, const Eigen::Vector3d& point) const;

 private:
  struct Triangle {
    std::array<Eigen::Vector3d, 3> corners;
    Eigen::Vector3d normal;  // unit; zero if the corners lie on a line

    double SquaredDistance(const Eigen::Vector3d& point, double least) const;
  };
  struct Node {
    Eigen::AlignedBox3d box;
    uint32_t first = 0;  // of the triangles of a leaf
    uint32_t count = 0;  // 0: not a leaf
    uint32_t right = 0;  // the other child; the first one follows its parent
  };

  void Build(uint32_t first, uint32_t count);
  void Search(uint32_t node, const Eigen::Vector3d& point, double& least, uint32_t& nearest) const;

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace silhouette
