// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/obstacles.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "capture/sim/placed_shape.h"
#include "capture/sim/yaml_values.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {
namespace {

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
  PlacedShape placed = ReadPlacedShape(map, "an obstacle", folder);
  obstacle.mesh = std::move(placed.mesh);
  obstacle.world_from_obstacle = placed.pose;
  obstacle.brightness = placed.brightness;
  obstacle.tint = placed.tint;
  map.Read("velocity", obstacle.velocity, ReadVector);
  if (const auto waypoints = map.Optional("waypoints")) {
    if (!obstacle.velocity.isZero()) waypoints->Fail("give either a velocity or waypoints");
    obstacle.waypoints = ReadWaypoints(*waypoints);
  }
  map.Finish();
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
