// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/triangle_mesh.h"
#include "calib/robot/mesh_path.h"
#include "calib/robot/whole_mesh.h"
#include "db/status/status_macros.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <span>
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

namespace {

void Append(const aiMesh& part, const Eigen::Vector3d& scale, TriangleMesh& mesh) {
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    const aiVector3D& vertex = part.mVertices[i];
    mesh.vertices.push_back(scale.cwiseProduct(Eigen::Vector3d(vertex.x, vertex.y, vertex.z)));
  }
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;  // points and lines
    mesh.triangles.push_back(
        {first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
  }
}

bool AllFinite(const aiScene& scene) {
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
    const std::span vertices(scene.mMeshes[i]->mVertices, scene.mMeshes[i]->mNumVertices);
    const bool finite = std::ranges::all_of(vertices, [](const aiVector3D& vertex) {
      return std::isfinite(vertex.x) && std::isfinite(vertex.y) && std::isfinite(vertex.z);
    });
    if (!finite) return false;
  }
  return true;
}

// What a Git clone without its large files has in place of them.
bool IsLfsPointer(const std::string& path) {
  std::string line;
  std::ifstream in(path);
  return std::getline(in, line) && line.starts_with("version https://git-lfs");
}

}  // namespace

absl::StatusOr<TriangleMesh> LoadMesh(const std::string& path, const Eigen::Vector3d& scale) {
  if (!std::filesystem::is_regular_file(path)) {
    return NotFound("the mesh '", path, "' does not exist", InOtherCase(path),
                    "; correct its name in the URDF");
  }
  if (IsLfsPointer(path)) {
    return InvalidArgument("the mesh '" + path + "' is a pointer to the mesh: git lfs pull");
  }
  // Before assimp, which crashes at some files that are cut off.
  RETURN_IF_ERROR(CheckWhole(path));
  Assimp::Importer importer;
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS |
                                  aiComponent_COLORS | aiComponent_TEXCOORDS |
                                  aiComponent_MATERIALS);
  const auto no_number = [&] {
    return InvalidArgument("the mesh '" + path +
                           "' has a vertex that is no number; export it again");
  };
  const aiScene* scene = importer.ReadFile(path, 0);
  // Joining takes a vertex that is no number for one beside it.
  if (scene != nullptr && !AllFinite(*scene)) return no_number();
  if (scene != nullptr) {
    scene = importer.ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_Triangulate |
                                         aiProcess_JoinIdenticalVertices |
                                         aiProcess_PreTransformVertices);
  }
  if (scene == nullptr) {
    constexpr size_t kMostOfError = 100;  // it may have the rest of the file
    return InvalidArgument("the mesh '" + path + "' cannot be read: " +
                           std::string(importer.GetErrorString()).substr(0, kMostOfError) +
                           "; export it again, as binary STL, say");
  }
  TriangleMesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) Append(*scene->mMeshes[i], scale, mesh);
  if (mesh.triangles.empty()) {
    return InvalidArgument("the mesh '" + path + "' has no triangles; export it with some");
  }
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    if (!vertex.allFinite()) return no_number();
  }
  return mesh;
}

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

double MeshTree::DistanceFrom(uint32_t triangle, const Vector3d& point) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return std::sqrt(triangles_.at(triangle).SquaredDistance(point, kInfinity));
}

double MeshTree::Distance(const Vector3d& point, uint32_t& hint) const {
  if (triangles_.empty()) return std::numeric_limits<double>::infinity();
  double least = triangles_[hint].SquaredDistance(point, std::numeric_limits<double>::infinity());
  Search(0, point, least, hint);
  return std::sqrt(least);
}

}  // namespace silhouette
