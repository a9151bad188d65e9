#include "capture/sim/obstacles.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "calib/mesh_file.h"
#include "capture/sim/yaml_values.h"
#include "tools/yaml/strict_yaml.h"

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

std::vector<Waypoint> ReadWaypoints(const YamlNode& node) {
  std::vector<Waypoint> waypoints;
  for (const YamlNode& item : node.Items()) {
    YamlMap map(item);
    const YamlNode time = map.Required("time");
    waypoints.push_back({time.AsSeconds(), ReadVector(map.Required("position"))});
    map.Finish();
    if (waypoints.size() > 1 && waypoints[waypoints.size() - 2].time >= waypoints.back().time) {
      time.Fail("the times of waypoints must grow");
    }
  }
  if (waypoints.empty()) node.Fail("at least one waypoint is expected");
  return waypoints;
}

Obstacle ReadObstacle(const YamlNode& node, const std::string& folder) {
  YamlMap map(node);
  Obstacle obstacle;
  obstacle.name = map.Get<std::string>("name");
  std::optional<std::string> kind;
  for (const char* candidate : {"box", "sphere", "capsule", "cylinder", "mesh"}) {
    const auto shape = map.Optional(candidate);
    if (!shape) continue;
    if (kind) shape->Fail("an obstacle has one shape, this one is a " + *kind + " already");
    kind = candidate;
    obstacle.mesh = ReadShape(candidate, *shape, folder);
  }
  const YamlNode position = map.Required("position");
  const auto rotation = map.Optional("rotation");
  obstacle.world_from_obstacle =
      Eigen::Translation3d(ReadVector(position)) *
      (rotation ? ReadRotation(*rotation) : Eigen::Quaterniond::Identity());
  if (const auto brightness = map.Optional("brightness")) {
    obstacle.brightness = ReadShare(*brightness);
  }
  if (const auto colour = map.Optional("colour")) {
    if (map.Optional("brightness")) colour->Fail("give either a colour or a brightness");
    const Eigen::Vector3d value = ReadColour(*colour);
    obstacle.brightness = Luminance(value);
    obstacle.tint = TintOf(value);
  }
  if (const auto velocity = map.Optional("velocity")) obstacle.velocity = ReadVector(*velocity);
  if (const auto waypoints = map.Optional("waypoints")) {
    if (!obstacle.velocity.isZero()) waypoints->Fail("give either a velocity or waypoints");
    obstacle.waypoints = ReadWaypoints(*waypoints);
  }
  map.Finish();
  if (!kind) node.Fail("a shape is missing: box, sphere, capsule, cylinder or mesh");
  return obstacle;
}

}  // namespace

Eigen::Isometry3d Obstacle::PoseAt(double time) const {
  Eigen::Isometry3d pose = world_from_obstacle;
  if (waypoints.empty()) {
    pose.translation() += time * velocity;
    return pose;
  }
  const auto next = std::find_if(waypoints.begin(), waypoints.end(),
                                 [&](const Waypoint& waypoint) { return waypoint.time > time; });
  if (next == waypoints.begin()) {
    pose.translation() = waypoints.front().position;
  } else if (next == waypoints.end()) {
    pose.translation() = waypoints.back().position;
  } else {
    const Waypoint& before = *(next - 1);
    const double share = (time - before.time) / (next->time - before.time);
    pose.translation() = before.position + share * (next->position - before.position);
  }
  return pose;
}

absl::StatusOr<std::vector<Obstacle>> LoadObstacles(const std::string& path) {
  try {
    const std::string folder = std::filesystem::path(path).parent_path().string();
    YamlMap map(YamlNode::FromFile(path));
    std::vector<Obstacle> obstacles;
    std::set<std::string> names;
    for (const YamlNode& item : map.Required("obstacles").Items()) {
      obstacles.push_back(ReadObstacle(item, folder));
      if (!names.insert(obstacles.back().name).second) {
        item.Fail("there is another obstacle called '" + obstacles.back().name + "'");
      }
    }
    map.Finish();
    return obstacles;
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

}  // namespace silhouette
