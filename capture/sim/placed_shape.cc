#include "capture/sim/placed_shape.h"

#include <filesystem>
#include <optional>
#include <utility>

#include "calib/robot/triangle_mesh.h"
#include "capture/sim/yaml_values.h"

namespace silhouette {
namespace {

TriangleMesh ReadMesh(YamlMap& shape, const std::string& folder) {
  const YamlNode file = shape.Required("file");
  const auto scale = shape.Optional("scale");
  const std::filesystem::path path = std::filesystem::path(folder) / file.As<std::string>();
  absl::StatusOr<TriangleMesh> mesh =
      LoadMesh(path.string(), scale ? ReadVector(*scale) : Eigen::Vector3d::Ones());
  if (!mesh.ok()) file.Fail(std::string(mesh.status().message()));
  return *std::move(mesh);
}

TriangleMesh ReadShape(const std::string& kind, const YamlNode& node, const std::string& folder) {
  YamlMap shape(node);
  TriangleMesh mesh;
  const auto length = [&](const char* key) { return ReadPositive(shape.Required(key)); };
  if (kind == "box") {
    const YamlNode size = shape.Required("size");
    const Eigen::Vector3d edges = ReadVector(size);
    if (!(edges.minCoeff() > 0)) size.Fail("three lengths greater than 0 are expected");
    mesh = BoxMesh(edges);
  } else if (kind == "sphere") {
    mesh = SphereMesh(length("radius"));
  } else if (kind == "mesh") {
    mesh = ReadMesh(shape, folder);
  } else {
    const double radius = length("radius");
    mesh = kind == "capsule" ? CapsuleMesh(radius, length("length"))
                             : CylinderMesh(radius, length("length"));
  }
  shape.Finish();
  return mesh;
}

}  // namespace

PlacedShape ReadPlacedShape(YamlMap& map, const std::string& what, const std::string& folder) {
  PlacedShape placed;
  std::optional<std::string> kind;
  for (const char* candidate : {"box", "sphere", "capsule", "cylinder", "mesh"}) {
    const auto shape = map.Optional(candidate);
    if (!shape) continue;
    if (kind) shape->Fail(what + " has one shape, this one is a " + *kind + " already");
    kind = candidate;
    placed.mesh = ReadShape(candidate, *shape, folder);
  }
  const YamlNode position = map.Required("position");
  const auto rotation = map.Optional("rotation");
  placed.pose = Eigen::Translation3d(ReadVector(position)) *
                (rotation ? ReadRotation(*rotation) : Eigen::Quaterniond::Identity());
  if (const auto brightness = map.Optional("brightness")) {
    placed.brightness = ReadShare(*brightness);
  }
  if (const auto colour = map.Optional("colour")) {
    if (map.Optional("brightness")) colour->Fail("give either a colour or a brightness");
    const Eigen::Vector3d value = ReadColour(*colour);
    placed.brightness = Luminance(value);
    placed.tint = TintOf(value);
  }
  if (!kind) map.node().Fail("a shape is missing: box, sphere, capsule, cylinder or mesh");
  return placed;
}

}  // namespace silhouette
