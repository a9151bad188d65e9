// SPDX-License-Identifier: Apache-2.0
#include "server/collision/obstacle_image.h"

#include <stdexcept>
#include <utility>

namespace silhouette {

ObstacleImage::ObstacleImage(Mask obstacle, Mask unknown, Mask error)
    : obstacle_(std::move(obstacle)), unknown_(std::move(unknown)), error_(std::move(error)) {}

ObstacleImage ObstacleImage::FromScene(const Mask& scene, const Mask& robot) {
  return FromScene(scene, robot, robot);
}

ObstacleImage ObstacleImage::FromScene(const Mask& scene, const Mask& anywhere,
                                       const Mask& certain) {
  if (!(certain - anywhere).Empty()) {
    throw std::invalid_argument("the corners' intersection is not within their union");
  }
  return ObstacleImage(scene - anywhere, scene & anywhere, certain - scene);
}

ObstacleImage ObstacleImage::FromObstacles(const Mask& obstacles, const Mask& anywhere) {
  return ObstacleImage(obstacles, anywhere - obstacles, Mask(obstacles.size()));
}

ObstacleImage ObstacleImage::Ignoring(const Mask& ignored) const {
  return ObstacleImage(obstacle_ - ignored, unknown_ | ignored, error_ - ignored);
}

ObstacleImage ObstacleImage::WithMargin(double margin) const {
  if (margin < 0) throw std::invalid_argument("a margin must not be negative");
  const Mask obstacle = Grown(obstacle_, margin);
  const Mask unknown = Grown(unknown_, margin) - error_ - obstacle;
  return ObstacleImage(obstacle, unknown, Grown(error_, margin) - unknown - obstacle);
}

Mask ObstacleImage::Background() const { return ~(obstacle_ | unknown_ | error_); }

IntersectionImage::IntersectionImage(const ObstacleImage& obstacle_image, const Mask& test_robot)
    : obstacle_(obstacle_image.obstacle() & test_robot),
      unknown_(obstacle_image.unknown() & test_robot),
      error_(obstacle_image.error() & test_robot) {}

}  // namespace silhouette
