// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/sampler.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "calib/robot/drawing/motion_check.h"

namespace silhouette {
namespace {

// Parts that are near each other at nearly all configurations are built so.
constexpr int kLearnt = 400;
constexpr double kBuiltSo = 0.9;
// They are learnt at so much more than the clearance, metres: rounding must not decide of links
// that keep just the clearance whatever the joints do.
constexpr double kBeyond = 0.01;
// Of Gilbert's algorithm; parts that it cannot tell apart then count as near.
constexpr int kMostSteps = 60;

}  // namespace

ModelSampler::ModelSampler(const DrawnRobot& robot, std::span<const GridJoint> joints,
                           const Eigen::AlignedBox3d& workspace, JointRegions forbidden,
                           const SamplerSettings& settings, uint64_t seed)
    : robot_(robot),
      joints_(joints.begin(), joints.end()),
      workspace_(workspace),
      forbidden_(std::move(forbidden)),
      settings_(settings),
      random_(seed),
      balls_(robot.parts().size()) {
  if (joints_.size() != robot.chain().joints().size()) {
    throw std::invalid_argument("not a range for each joint of the robot");
  }
  const std::vector<RobotPart>& parts = robot.parts();
  for (size_t ball = 0; ball < robot.balls().balls(); ++ball) {
    balls_[robot.balls().part(ball)].push_back(ball);
  }
  for (size_t part = 0; part < parts.size(); ++part) {
    bool moves = false;
    for (size_t joint = 0; joint < robot.chain().joints().size(); ++joint) {
      moves = moves || robot.Lever(part, joint) > 0;
    }
    moves_.push_back(moves);
  }
  const auto parent = [&](size_t link) { return robot.chain().links()[link].parent; };
  for (size_t a = 0; a < parts.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      const size_t first = parts[a].link;
      const size_t second = parts[b].link;
      if (first == second || parent(first) == static_cast<int>(second) ||
          parent(second) == static_cast<int>(first)) {
        continue;
      }
      const bool near = JointsBetween(first, second) <= 2;
      pairs_.push_back(
          {.a = a, .b = b, .clearance = near ? settings.clearance_of_near : settings.clearance});
    }
  }
  LearnPairs();
}

int ModelSampler::JointsBetween(size_t first, size_t second) const {
  const std::span<const ChainLink> links = robot_.chain().links();
  int joints = 0;
  // Parents stand before their children.
  while (first != second) {
    size_t& later = first > second ? first : second;
    if (links[later].joint >= 0) ++joints;
    later = static_cast<size_t>(links[later].parent);
  }
  return joints;
}

void ModelSampler::LearnPairs() {
  met_.assign(pairs_.size(), 0);
  for (PartPair& pair : pairs_) pair.clearance += kBeyond;
  for (int i = 0; i < kLearnt; ++i) {
    robot_.chain().Pose(Any(), poses_);
    robot_.balls().Place(poses_, {}, placed_);
    MeetsItself(/*learn=*/true);
  }
  std::vector<PartPair> pairs;
  for (size_t i = 0; i < pairs_.size(); ++i) {
    if (met_[i] < kBuiltSo * kLearnt) pairs.push_back(pairs_[i]);
  }
  pairs_ = std::move(pairs);
  for (PartPair& pair : pairs_) pair.clearance -= kBeyond;
}

Configuration ModelSampler::Any() {
  Configuration q;
  for (const GridJoint& joint : joints_) {
    q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random_));
  }
  return q;
}

bool ModelSampler::BallsAreNear(const PartPair& pair) const {
  const PartBalls& balls = robot_.balls();
  return std::ranges::any_of(balls_[pair.a], [&](size_t of_a) {
    return std::ranges::any_of(balls_[pair.b], [&](size_t of_b) {
      const double x = placed_.x[of_a] - placed_.x[of_b];
      const double y = placed_.y[of_a] - placed_.y[of_b];
      const double z = placed_.z[of_a] - placed_.z[of_b];
      const double apart = balls.radius(of_a) + balls.radius(of_b) + placed_.growth[of_a] +
                           placed_.growth[of_b] + pair.clearance;
      return x * x + y * y + z * z < apart * apart;
    });
  });
}

bool ModelSampler::AreNear(const PartPair& pair) const {
  const RobotPart& first = robot_.parts()[pair.a];
  const RobotPart& second = robot_.parts()[pair.b];
  const Eigen::Isometry3d& from_first = poses_[first.moves_with];
  const Eigen::Isometry3d& from_second = poses_[second.moves_with];
  const double apart = first.radius + second.radius + pair.clearance;
  // The difference of two points, one of each part, that is least along `towards`.
  const auto least = [&](const Eigen::Vector3d& towards) -> Eigen::Vector3d {
    Eigen::Index near = 0;
    Eigen::Index far = 0;
    (towards.transpose() * from_first.linear() * first.points).minCoeff(&near);
    (towards.transpose() * from_second.linear() * second.points).maxCoeff(&far);
    return from_first * first.points.col(near) - from_second * second.points.col(far);
  };
  Eigen::Vector3d difference =
      from_first * first.points.col(0) - from_second * second.points.col(0);
  for (int i = 0; i < kMostSteps; ++i) {
    const double distance = difference.norm();
    if (distance < apart) return true;
    const Eigen::Vector3d next = least(difference);
    // No difference is shorter than this.
    if (difference.dot(next) >= apart * distance) return false;
    const Eigen::Vector3d step = next - difference;
    const double share = -difference.dot(step) / std::max(step.squaredNorm(), 1e-18);
    difference += std::clamp(share, 0.0, 1.0) * step;
  }
  return true;  // not known
}

bool ModelSampler::MeetsItself(bool learn) {
  for (size_t i = 0; i < pairs_.size(); ++i) {
    const bool meet = BallsAreNear(pairs_[i]) && AreNear(pairs_[i]);
    if (meet && !learn) return true;
    if (meet) ++met_[i];
  }
  return false;
}

bool ModelSampler::IsClear(std::span<const double> q) {
  robot_.chain().Pose(q, poses_);
  robot_.balls().Place(poses_, {}, placed_);
  for (size_t part = 0; part < balls_.size(); ++part) {
    for (const size_t ball : balls_[part]) {
      if (!moves_[part]) break;
      const double room = robot_.balls().radius(ball) + placed_.growth[ball] + settings_.clearance;
      const Eigen::Vector3d centre(placed_.x[ball], placed_.y[ball], placed_.z[ball]);
      if (((centre - workspace_.min()).array() < room).any() ||
          ((workspace_.max() - centre).array() < room).any()) {
        return false;
      }
    }
  }
  return !MeetsItself(/*learn=*/false);
}

bool ModelSampler::IsClearWay(std::span<const double> from, std::span<const double> to) {
  if (forbidden_.Between(from, to)) return false;
  const auto steps =
      static_cast<int>(std::ceil(GreatestDisplacement(robot_, from, to) / settings_.step));
  Configuration q(from.size());
  for (int i = 0; i <= steps; ++i) {
    const double share = steps == 0 ? 1 : static_cast<double>(i) / steps;
    for (size_t j = 0; j < q.size(); ++j) q[j] = from[j] + share * (to[j] - from[j]);
    if (!IsClear(q)) return false;
  }
  return true;
}

std::optional<Configuration> ModelSampler::Next(const Configuration& here) {
  for (int i = 0; i < settings_.most_tries; ++i) {
    Configuration q = Any();
    if (IsClear(q) && IsClearWay(here, q)) return q;
  }
  return std::nullopt;
}

}  // namespace silhouette
