// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/pose_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

constexpr int kCandidates = 80;      // of which the best is taken
constexpr int kMostDraws = 4000;     // for all of them
constexpr size_t kExploreEvery = 4;  // every n-th pose is taken, whatever was seen
constexpr double kFar = 10;
constexpr double kNews = 0.25;  // metres from all others; what is farther is no better
constexpr double kMetresPerRadian = 0.4;

}  // namespace

PosePlan::PosePlan(const RobotModel& robot, size_t flange, Positions rest,
                   std::vector<MovingJoint> joints, uint64_t seed)
    : robot_(robot),
      flange_(flange),
      rest_(std::move(rest)),
      joints_(std::move(joints)),
      random_(seed) {
  if (rest_.size() != robot_.joints().size() || flange_ >= robot_.links().size()) {
    throw std::invalid_argument("the robot has other joints or links");
  }
  if (joints_.empty()) throw std::invalid_argument("no joint may be moved");
  for (const MovingJoint& joint : joints_) {
    if (joint.joint >= rest_.size() || !(joint.lower <= joint.upper)) {
      throw std::invalid_argument("a joint that the robot does not have, or no range");
    }
  }
}

PosePlan::Stand PosePlan::StandAt(const Positions& positions) const {
  const Eigen::Isometry3d base_from_flange = robot_.LinkPoses(positions)[flange_];
  return {base_from_flange.translation(), base_from_flange.linear().col(2), {}};
}

double PosePlan::DistanceBetween(const Stand& a, const Stand& b) {
  const double turned = std::acos(std::clamp(a.direction.dot(b.direction), -1.0, 1.0));
  return (a.place - b.place).norm() + kMetresPerRadian * turned;
}

std::string PosePlan::ViewInNeed() const {
  std::string view;
  int least = std::numeric_limits<int>::max();
  for (const auto& [name, times] : seen_) {
    if (times >= least) continue;
    least = times;
    view = name;
  }
  return view;
}

std::optional<PosePlan::Positions> PosePlan::Next(const Allowed& allowed) {
  const std::string view = ViewInNeed();
  const bool explore = view.empty() || tried_.size() % kExploreEvery == 0;
  std::optional<Positions> best;
  double best_merit = -1;
  int candidates = 0;
  for (int draw = 0; draw < kMostDraws && candidates < kCandidates; ++draw) {
    Positions positions = rest_;
    for (const MovingJoint& joint : joints_) {
      const double share = static_cast<double>(random_() >> 11) * 0x1p-53;
      positions[joint.joint] = joint.lower + share * (joint.upper - joint.lower);
    }
    if (!allowed(positions)) continue;
    ++candidates;
    const Stand stand = StandAt(positions);
    double nearest = kFar;
    bool promising = explore;  // else: the view saw the board from the nearest pose that was tried
    for (const Stand& other : tried_) {
      const double distance = DistanceBetween(stand, other);
      if (distance >= nearest) continue;
      nearest = distance;
      if (!explore) promising = other.views.contains(view);
    }
    const double distance = explore ? nearest : std::min(nearest, kNews);
    // What is not promising is only taken if nothing is.
    const double merit = promising ? 1 + distance : distance / 100;
    if (merit <= best_merit) continue;
    best_merit = merit;
    best = positions;
  }
  return best;
}

void PosePlan::Tell(const Positions& positions, std::span<const std::string> views) {
  tried_.push_back(StandAt(positions));
  tried_.back().views.insert(views.begin(), views.end());
  for (const std::string& view : views) ++seen_[view];
}

}  // namespace silhouette
