// MeshTree: how far a point is from the surface of a triangle mesh.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "calib/robot/triangle_mesh.h"

namespace silhouette {

// A tree of boxes over the triangles. Cannot be changed once made; used by any number of threads.
class MeshTree {
 public:
  explicit MeshTree(const TriangleMesh& mesh);

  // The distance of `point` from the nearest triangle; infinity if there is none. `hint`: a
  // triangle that may be near, by its place in the tree; on return the nearest one's. 0 to begin
  // with.
  double Distance(const Eigen::Vector3d& point, uint32_t& hint) const;

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
