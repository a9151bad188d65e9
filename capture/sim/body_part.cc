// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/body_part.h"

#include <utility>

#include "capture/sim/yaml_values.h"

namespace silhouette {
std::vector<BodyPart> BodyPartsOf(const RobotModel& robot) {
  std::vector<BodyPart> parts;
  for (size_t link = 0; link < robot.links().size(); ++link) {
    for (const LinkGeometry& geometry : robot.links()[link].body()) {
      BodyPart part{
          .name = robot.links()[link].name, .frame = link, .mesh = Tessellate(geometry.shape)};
      for (Eigen::Vector3d& vertex : part.mesh.vertices) {
        vertex = geometry.link_from_shape * vertex;
      }
      if (geometry.colour) {
        part.brightness = Luminance(*geometry.colour);
        part.tint = TintOf(*geometry.colour);
      }
      parts.push_back(std::move(part));
    }
  }
  return parts;
}

std::vector<BodyPart> ObstacleParts(std::span<const Obstacle> obstacles) {
  std::vector<BodyPart> parts;
  for (size_t i = 0; i < obstacles.size(); ++i) {
    parts.push_back({.name = obstacles[i].name,
                     .frame = i,
                     .mesh = obstacles[i].mesh,
                     .brightness = obstacles[i].brightness,
                     .tint = obstacles[i].tint});
  }
  return parts;
}

Poses ObstaclePoses(std::span<const Obstacle> obstacles, double time) {
  Poses poses;
  for (const Obstacle& obstacle : obstacles) poses.push_back(obstacle.PoseAt(time));
  return poses;
}

}  // namespace silhouette
