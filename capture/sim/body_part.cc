#include "capture/sim/body_part.h"

#include <utility>

namespace silhouette {
namespace {

// What a grey camera sees of a colour.
double Luminance(const Eigen::Vector3d& colour) {
  return colour.dot(Eigen::Vector3d(0.299, 0.587, 0.114));
}

}  // namespace

std::vector<BodyPart> RobotParts(const RobotModel& robot) {
  std::vector<BodyPart> parts;
  for (size_t link = 0; link < robot.links().size(); ++link) {
    for (const LinkGeometry& geometry : robot.links()[link].body()) {
      BodyPart part{
          .name = robot.links()[link].name, .frame = link, .mesh = Tessellate(geometry.shape)};
      for (Eigen::Vector3d& vertex : part.mesh.vertices) {
        vertex = geometry.link_from_shape * vertex;
      }
      if (geometry.colour) part.brightness = Luminance(*geometry.colour);
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
                     .brightness = obstacles[i].brightness});
  }
  return parts;
}

Poses ObstaclePoses(std::span<const Obstacle> obstacles, double time) {
  Poses poses;
  for (const Obstacle& obstacle : obstacles) poses.push_back(obstacle.PoseAt(time));
  return poses;
}

}  // namespace silhouette
