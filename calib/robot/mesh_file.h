// Reading meshes from files: STL, OBJ, Collada, PLY and whatever else assimp knows.
#pragma once

#include <Eigen/Core>
#include <string>

#include "absl/status/statusor.h"
#include "calib/robot/triangle_mesh.h"

namespace silhouette {

// All triangles of a file in the file's own frame, in metres; a Collada file's unit counts, its up
// axis does not (as with other readers of URDF). `scale` multiplies x, y and z.
// NotFound: no such file. InvalidArgument: not a mesh, or one without triangles.
absl::StatusOr<TriangleMesh> LoadMesh(const std::string& path, const Eigen::Vector3d& scale);

}  // namespace silhouette
