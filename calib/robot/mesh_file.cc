#include "calib/robot/mesh_file.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <filesystem>
#include <utility>

namespace silhouette {
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

}  // namespace

absl::StatusOr<TriangleMesh> LoadMesh(const std::string& path, const Eigen::Vector3d& scale) {
  if (!std::filesystem::is_regular_file(path)) {
    return absl::NotFoundError("the mesh '" + path + "' does not exist");
  }
  Assimp::Importer importer;
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS |
                                  aiComponent_COLORS | aiComponent_TEXCOORDS |
                                  aiComponent_MATERIALS);
  const aiScene* scene =
      importer.ReadFile(path, aiProcess_RemoveComponent | aiProcess_Triangulate |
                                  aiProcess_JoinIdenticalVertices | aiProcess_PreTransformVertices);
  if (scene == nullptr) {
    return absl::InvalidArgumentError("the mesh '" + path +
                                      "' cannot be read: " + importer.GetErrorString());
  }
  TriangleMesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) Append(*scene->mMeshes[i], scale, mesh);
  if (mesh.triangles.empty()) {
    return absl::InvalidArgumentError("the mesh '" + path + "' has no triangles");
  }
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    if (!vertex.allFinite()) {
      return absl::InvalidArgumentError("the mesh '" + path + "' has a vertex that is no number");
    }
  }
  return mesh;
}

}  // namespace silhouette
