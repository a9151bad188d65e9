// SPDX-License-Identifier: Apache-2.0
// DrawnChecker: which views show an obstacle inside the robot's image, at any joint values. Uses
// the standard library and Eigen alone.
//
// A view shows one exactly if DrawnRobot::AddTouched sets a pixel that its plane has.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/mask.h"

namespace silhouette {

// For one thread at a time; after a few checks nothing allocates.
struct DrawnCheckScratch {
  DrawingScratch drawing;
  std::vector<Eigen::Isometry3d> base_from_link;
  std::vector<uint64_t> words;
};

// The planes that show obstacles in one scene, prepared for questions about a robot at any joint
// values. Cannot be changed once made; used by any number of threads, each with scratch of its own.
class DrawnChecker {
 public:
  // `shown`: one per view of the robot; nothing: the view is missing, it counts as showing an
  // obstacle. Throws std::invalid_argument if there is no robot, or there are more or fewer planes
  // than views, or one of another size.
  DrawnChecker(std::shared_ptr<const DrawnRobot> robot, std::vector<std::optional<Mask>> shown);

  const DrawnRobot& robot() const { return *robot_; }

  // The number of views that show an obstacle inside the robot's image at `q`, each part grown by
  // `growth`, or `enough` if there are as many or more. Joint values that are not finite: all
  // views. Limits are not looked at. Throws std::invalid_argument if `enough` is below 1, or there
  // is not a value for each joint, or not a growth for each part.
  int Showing(std::span<const double> q, Growth growth, int enough,
              DrawnCheckScratch& scratch) const;

 private:
  bool Shows(size_t view, Growth growth, DrawnCheckScratch& scratch) const;

  std::shared_ptr<const DrawnRobot> robot_;
  std::vector<Mask> planes_;  // by view; empty where it is missing
  int missing_ = 0;
};

}  // namespace silhouette
