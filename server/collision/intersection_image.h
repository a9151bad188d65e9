// The intersection image: what an obstacle image says about one test configuration (paper §3.2).
//
// Table 2: the value of the obstacle image where the robot image of the test configuration shows
// the robot, background elsewhere. An intersection image cannot be changed once made.
//
// Checks need no pictures, only whether and how much: CollisionChecker finds that without making
// any.
#pragma once

#include "db/mask/mask.h"
#include "server/collision/obstacle_image.h"

namespace silhouette {

class IntersectionImage {
 public:
  // Throws std::invalid_argument if the sizes differ.
  IntersectionImage(const ObstacleImage& obstacle_image, const Mask& test_robot);

  MaskSize size() const { return obstacle_.size(); }
  const Mask& obstacle() const { return obstacle_; }
  const Mask& unknown() const { return unknown_; }
  const Mask& error() const { return error_; }

 private:
  Mask obstacle_;
  Mask unknown_;
  Mask error_;
};

}  // namespace silhouette
