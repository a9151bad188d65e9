// SPDX-License-Identifier: Apache-2.0
// Truth: whether the robot touches an obstacle, and how far they are apart, from the same triangles
// that the cameras see. The floor and the robot itself are no obstacles.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
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

// Truth for motions: whether the robot touches anything on its straight way, in joint space, from
// one configuration to another.

struct MotionContact {
  // Where the robot touches first; where it touches nothing, the narrowest place.
  double fraction = 0;            // 0 at the start, 1 at the end
  std::vector<double> positions;  // in the order of the robot's joints
  Contact contact;
};

// Can be used by any number of threads. `robot` and `checker` must outlive it.
class MotionChecker {
 public:
  // Between two places that are looked at no point of the robot moves farther than the robot was
  // away from the obstacles, nor than kCoarse. Where it is nearer than kFine, the step is kFine: a
  // graze less deep may go unseen. Metres.
  static constexpr double kFine = 0.001;
  static constexpr double kCoarse = 0.01;

  MotionChecker(const RobotModel& robot, const ContactChecker& checker);

  // All values in the order of the robot's joints; a continuous joint takes the way that its values
  // say. `obstacles`: their poses; they stand still.
  MotionContact Check(std::span<const double> from, std::span<const double> to,
                      const Poses& obstacles) const;

 private:
  const RobotModel& robot_;
  const ContactChecker& checker_;
  // How far a point of the robot moves at most per unit of the joint.
  std::vector<double> reach_;
};

}  // namespace silhouette
