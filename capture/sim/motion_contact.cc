#include "capture/sim/motion_contact.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "calib/robot/reach.h"

namespace silhouette {

MotionChecker::MotionChecker(const RobotModel& robot, const ContactChecker& checker)
    : robot_(robot), checker_(checker) {
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints()) names.push_back(joint.name);
  for (const RobotJoint& joint : robot.joints()) {
    // Every joint is told to move: Reach has nothing left to refuse.
    reach_.push_back(
        joint.type == JointType::kPrismatic ? 1 : Reach(robot, joint.name, names, {}, 0).value());
  }
}

MotionContact MotionChecker::Check(std::span<const double> from, std::span<const double> to,
                                   const Poses& obstacles) const {
  std::vector<double> way;
  double travel = 0;  // metres that any point moves at most
  for (size_t j = 0; j < from.size(); ++j) {
    way.push_back(to[j] - from[j]);
    if (robot_.joints()[j].type == JointType::kContinuous) {
      way[j] = std::remainder(way[j], 2 * std::numbers::pi);
    }
    travel += reach_[j] * std::abs(way[j]);
  }
  MotionContact nearest;
  for (double fraction = 0;;) {
    std::vector<double> positions(from.begin(), from.end());
    for (size_t j = 0; j < way.size(); ++j) positions[j] += fraction * way[j];
    const Contact contact = checker_.Check(robot_.LinkPoses(positions), obstacles);
    if (nearest.positions.empty() || contact.distance < nearest.contact.distance) {
      nearest = {.fraction = fraction, .positions = positions, .contact = contact};
    }
    if (contact.touching || fraction >= 1 || travel == 0) return nearest;
    fraction = std::min(1.0, fraction + std::clamp(contact.distance, kFine, kCoarse) / travel);
  }
}

}  // namespace silhouette
