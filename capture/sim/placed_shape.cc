// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/placed_shape.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
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
  const auto length = [&](const char* key) { return shape.Required(key).AsPositive(); };
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
  map.Read("brightness", placed.brightness, &YamlNode::AsShare);
  if (const auto colour = map.Optional("colour")) {
    if (map.Optional("brightness")) colour->Fail("give either a colour or a brightness");
    const Eigen::Vector3d value = ReadColour(*colour);
    placed.brightness = Luminance(value);
    placed.tint = TintOf(value);
  }
  if (!kind) map.node().Fail("a shape is missing: box, sphere, capsule, cylinder or mesh");
  return placed;
}

CarriedParts ReadCarriedParts(const YamlNode& node) {
  const std::string folder = std::filesystem::path(node.file()).parent_path().string();
  CarriedParts parts;
  YamlMap variants(node);
  for (const std::string& variant : variants.Keys()) {
    std::vector<CarriedPart>& carried = parts[variant];
    for (const YamlNode& item : variants.Required(variant).Items()) {
      YamlMap map(item);
      const std::string link = map.Get<std::string>("link");
      carried.push_back({link, ReadPlacedShape(map, "a part", folder)});
      map.Finish();
    }
  }
  return parts;
}

absl::StatusOr<RobotModel> Carrying(const RobotModel& robot, const CarriedParts& parts,
                                    const std::string& variant) {
  const auto found = parts.find(variant);
  if (found == parts.end()) {
    if (parts.empty() || variant == kBareVariant) return robot;
    return absl::InvalidArgumentError(absl::StrCat(
        "'parts' does not say what the robot carries in the variant '", variant, "', only in ",
        absl::StrJoin(parts, ", ",
                      [](std::string* out, const auto& known) {
                        absl::StrAppend(out, "'", known.first, "'");
                      }),
        "; state '", variant, ": []' if it is nothing"));
  }
  RobotModel carrying = robot;
  for (const CarriedPart& part : found->second) {
    const auto link = std::ranges::find(robot.links(), part.link, &RobotLink::name);
    if (link == robot.links().end()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "a part of the variant '", variant, "' is on the link '", part.link,
          "', which the robot does not have; its links are ",
          absl::StrJoin(robot.links(), ", ", [](std::string* out, const RobotLink& known) {
            absl::StrAppend(out, known.name);
          })));
    }
    carrying = carrying.WithBody(
        static_cast<size_t>(link - robot.links().begin()),
        {.shape = MeshShape{.path = "", .mesh = std::make_shared<TriangleMesh>(part.shape.mesh)},
         .link_from_shape = part.shape.pose,
         .colour = part.shape.brightness * part.shape.tint});
  }
  return carrying;
}

}  // namespace silhouette
