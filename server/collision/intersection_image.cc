#include "server/collision/intersection_image.h"

namespace silhouette {

IntersectionImage::IntersectionImage(const ObstacleImage& obstacle_image, const Mask& test_robot)
    : obstacle_(obstacle_image.obstacle() & test_robot),
      unknown_(obstacle_image.unknown() & test_robot),
      error_(obstacle_image.error() & test_robot) {}

}  // namespace silhouette
