// SPDX-License-Identifier: Apache-2.0
// A mesh as convex pieces.
#pragma once

#include <vector>

#include "calib/robot/convex_hull.h"
#include "calib/robot/triangle_mesh.h"

namespace silhouette {

struct MeshPieces {
  // Every triangle of the mesh is in the union of the hulls.
  std::vector<ConvexBody> hulls;
  // Metres: every straight line that meets a hull passes the mesh, its holes closed, at no more
  // than this distance. An upper bound, above the true value by at most a quarter of the aim, or 5
  // %.
  double excess = 0;
};

// Cuts a mesh by planes until its hulls add no more than `most_excess` or there are `most_parts` of
// them; of all that was tried, what adds least. No hulls: the mesh is flat.
MeshPieces PiecesOf(const TriangleMesh& mesh, double most_excess, size_t most_parts);

// The hull of `points`, grown by `radius`, holds a body.
struct FewPoints {
  std::vector<Eigen::Vector3d> points;
  double radius = 0;
};

// Leaves points out of a body that has many, while the radius stays within `most_radius`, metres,
// if `most_points` are enough for that.
FewPoints FewPointsOf(const ConvexBody& body, double most_radius, size_t most_points);

// By how much a hull's faces must move inward until it holds no piece of the mesh's surface: then
// it is all inside the mesh's solid, or all outside.
double DepthOfSurface(const TriangleMesh& mesh, const ConvexBody& hull);

// Whether a closed mesh encloses a point that is not on its surface.
bool Encloses(const TriangleMesh& mesh, const Eigen::Vector3d& point);

}  // namespace silhouette
