// Truth: whether the robot touches an obstacle, and how far they are apart, from the same triangles
// that the cameras see. The floor and the robot itself are no obstacles.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "calib/robot/robot_model.h"
#include "capture/sim/body_part.h"
#include "capture/sim/obstacles.h"

namespace silhouette {

struct Contact {
  bool touching = false;
  // Metres between robot and obstacles, 0 if they touch; infinity if there is no obstacle.
  double distance = std::numeric_limits<double>::infinity();
  // The nearest pair; empty if there is no obstacle.
  std::string link;
  std::string obstacle;
};

// A place where robot and obstacle are in each other, in the world.
struct ContactPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  std::string link;
  std::string obstacle;
};

// Bounding volumes are built once. A closed body counts as solid: one that lies wholly inside
// another touches it. Can be used by any number of threads.
class ContactChecker {
 public:
  ContactChecker(const RobotModel& robot, std::span<const Obstacle> obstacles);
  ~ContactChecker();
  ContactChecker(const ContactChecker&) = delete;
  ContactChecker& operator=(const ContactChecker&) = delete;

  // `links`: poses of the robot's links. `obstacles`: poses of the obstacles.
  Contact Check(const Poses& links, const Poses& obstacles) const;

  // Check().touching alone, many times faster.
  bool Touches(const Poses& links, const Poses& obstacles) const;

  // Where they are in each other: places where their surfaces cross, and corners of the one that
  // lie in the other, at most `most` of each kind for every pair of bodies. Empty if nothing
  // touches.
  std::vector<ContactPoint> Points(const Poses& links, const Poses& obstacles, size_t most) const;

 private:
  struct Body;
  // Whether two bodies touch, in the world's frame.
  static bool Touch(const Body& link, const Eigen::Isometry3d& world_from_link,
                    const Body& obstacle, const Eigen::Isometry3d& world_from_obstacle);
  std::vector<Body> robot_;
  std::vector<Body> obstacles_;
};

}  // namespace silhouette
