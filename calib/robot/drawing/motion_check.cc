// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/motion_check.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "db/mask/interpolation.h"

namespace silhouette {
namespace {

// By part, how far a point of it moves at most from one end to the other.
std::vector<double> Displacements(const DrawnRobot& robot, std::span<const double> from,
                                  std::span<const double> to) {
  const size_t joints = robot.chain().joints().size();
  if (from.size() != joints || to.size() != joints) {
    throw std::invalid_argument("not a value for each joint");
  }
  std::vector<double> moved(robot.parts().size());
  for (size_t joint = 0; joint < joints; ++joint) {
    const double by = std::abs(to[joint] - from[joint]);
    if (!std::isfinite(by)) throw std::invalid_argument("a joint value is not finite");
    for (size_t part = 0; part < moved.size(); ++part) {
      moved[part] += by * robot.Lever(part, joint);
    }
  }
  return moved;
}

class MotionHalver {
 public:
  MotionHalver(const DrawnRobot& robot, std::span<const double> from, std::span<const double> to,
               double resolution, const std::function<bool(const MotionPlace&)>& is_free)
      : from_(from),
        to_(to),
        resolution_(resolution),
        is_free_(is_free),
        moved_(Displacements(robot, from, to)),
        farthest_(std::ranges::max(moved_)),
        q_(from.size()),
        growth_(moved_.size()) {}

  MotionCheck Check() {
    result_.free = IsFree(0, 1);
    return result_;
  }

 private:
  bool IsProven(double first, double last) {
    const double middle = (first + last) / 2;
    Interpolate(from_, to_, middle, q_);
    // A little more, for rounding.
    const double share = (last - first) / 2 * (1 + 1e-9);
    for (size_t part = 0; part < moved_.size(); ++part) growth_[part] = share * moved_[part];
    ++result_.checks;
    return is_free_({q_, growth_, middle, first, last});
  }

  bool IsFreeAt(double place, double first, double last) {
    if (place == known_free_) return true;
    Interpolate(from_, to_, place, q_);
    ++result_.checks;
    if (!is_free_({q_, {}, place, first, last})) {
      result_.fraction = place;
      return false;
    }
    known_free_ = place;
    return true;
  }

  bool IsFree(double first, double last) {
    if (IsProven(first, last)) return true;
    const double middle = (first + last) / 2;
    // Numbers have no middle any more if the motion is astronomic.
    if ((last - first) * farthest_ > resolution_ && first < middle && middle < last) {
      return IsFree(first, middle) && IsFree(middle, last);
    }
    result_.sampled_step = std::max(result_.sampled_step, (last - first) / 2 * farthest_);
    return IsFreeAt(first, first, last) && IsFreeAt(middle, first, last) &&
           IsFreeAt(last, first, last);
  }

  std::span<const double> from_;
  std::span<const double> to_;
  double resolution_;
  const std::function<bool(const MotionPlace&)>& is_free_;
  std::vector<double> moved_;  // by part, metres, all along
  double farthest_;
  std::vector<double> q_;
  std::vector<double> growth_;
  double known_free_ = -1;  // the last place found free, ungrown
  MotionCheck result_;
};

}  // namespace

MotionCheck CheckMotion(const DrawnRobot& robot, std::span<const double> from,
                        std::span<const double> to, double resolution,
                        const std::function<bool(const MotionPlace&)>& is_free) {
  if (!(resolution > 0)) throw std::invalid_argument("a resolution is above 0");
  return MotionHalver(robot, from, to, resolution, is_free).Check();
}

double GreatestDisplacement(const DrawnRobot& robot, std::span<const double> from,
                            std::span<const double> to) {
  return std::ranges::max(Displacements(robot, from, to));
}

double DisplacementBetween(const DrawnRobot& robot, std::span<const Eigen::Isometry3d> from,
                           std::span<const Eigen::Isometry3d> to) {
  double square = 0;
  for (const RobotPart& part : robot.parts()) {
    const Eigen::Affine3d moved(to[part.moves_with].matrix() - from[part.moves_with].matrix());
    for (const auto& point : part.points.colwise()) {
      square = std::max(square, (moved.linear() * point + moved.translation()).squaredNorm());
    }
  }
  return std::sqrt(square);
}

}  // namespace silhouette
