// Truth for motions: whether the robot touches anything on its straight way, in joint space, from
// one configuration to another.
#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/robot_model.h"
#include "capture/sim/contact.h"

namespace silhouette {

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

  // All values in the order of the robot's joints; a continuous joint takes the shorter way round.
  // `obstacles`: their poses; they stand still.
  MotionContact Check(std::span<const double> from, std::span<const double> to,
                      const Poses& obstacles) const;

 private:
  const RobotModel& robot_;
  const ContactChecker& checker_;
  // How far a point of the robot moves at most per unit of the joint.
  std::vector<double> reach_;
};

}  // namespace silhouette
