// SPDX-License-Identifier: Apache-2.0
// FloorCheck: whether a robot stays above a floor while its joints move.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "calib/robot/drawing/kinematic_chain.h"
#include "calib/robot/reach.h"
#include "calib/robot/robot_model.h"

namespace silhouette {

// Metres: a dip below the floor that is no deeper may be missed between two places.
inline constexpr double kFloorStep = 0.01;

// Of every link that a joint raises or lowers, its body and origin must not be below the floor. The
// others may be anywhere. Cannot be changed once made; used by any number of threads.
class FloorCheck {
 public:
  // `floor`: its height in the base's frame, metres. What the link `carrier` carries is within
  // `carried`, metres, of the link's origin.
  FloorCheck(const RobotModel& robot, BodyGeometry geometry, double floor, size_t carrier,
             double carried);

  // A link that is below the floor while all joints move evenly from `from` to `to`, by its index
  // in the model; nothing: none is. What is below at `from` does not count. Values of continuous
  // joints count as they are, not by the shorter way. Throws std::invalid_argument if there is not
  // a finite value for each joint of the model.
  std::optional<size_t> Below(std::span<const double> from, std::span<const double> to) const;

 private:
  struct Link {
    size_t number = 0;
    std::vector<LinkBall> balls;
    std::vector<double> levers;  // by joint, as KinematicChain::LeverOf, of all of the balls
  };

  const double floor_;
  const KinematicChain chain_;
  std::vector<Link> links_;  // that joints raise or lower
};

}  // namespace silhouette
