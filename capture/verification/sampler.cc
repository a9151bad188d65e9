// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/sampler.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "capture/verification/hull_distance.h"
#include "db/mask/interpolation.h"

namespace silhouette {
namespace {

// Configurations from which median widths are learnt.
constexpr int kLearnt = 400;
// How much narrower than where the robot stands a gap may become while the robot leaves, metres.
constexpr double kGivesWay = 0.0005;
// Widths beyond what is kept that are not measured any farther, metres.
constexpr double kFar = 0.3;

}  // namespace

ModelSampler::ModelSampler(const DrawnRobot& robot, std::span<const GridJoint> joints,
                           const Eigen::AlignedBox3d& workspace, JointRegions forbidden,
                           SamplerSettings settings, uint64_t seed)
    : robot_(robot),
      joints_(joints.begin(), joints.end()),
      workspace_(workspace),
      forbidden_(std::move(forbidden)),
      settings_(std::move(settings)),
      random_(seed),
      parts_(robot.chain().links().size()),
      balls_(robot.parts().size()) {
  if (joints_.size() != robot.chain().joints().size()) {
    throw std::invalid_argument("not a range for each joint of the robot");
  }
  for (size_t ball = 0; ball < robot.balls().balls(); ++ball) {
    balls_[robot.balls().part(ball)].push_back(ball);
  }
  for (size_t part = 0; part < robot.parts().size(); ++part) {
    parts_[robot.parts()[part].link].push_back(part);
  }
  for (size_t link = 0; link < parts_.size(); ++link) {
    for (int face = 0; face < 6; ++face) AddGapToFace(link, face);
    for (size_t other = 0; other < link; ++other) AddGapBetween(link, other);
  }
  LearnWhatIsNarrow();
}

std::vector<size_t> ModelSampler::JointsBetween(size_t first, size_t second) const {
  const std::span<const ChainLink> links = robot_.chain().links();
  std::vector<size_t> joints;
  // Parents stand before their children.
  while (first != second) {
    size_t& later = first > second ? first : second;
    if (links[later].joint >= 0) joints.push_back(static_cast<size_t>(links[later].joint));
    later = static_cast<size_t>(links[later].parent);
  }
  return joints;
}

bool ModelSampler::IsNextTo(size_t link, size_t other) const {
  const auto parent = [&](size_t at) {
    return static_cast<size_t>(robot_.chain().links()[at].parent);
  };
  size_t at = parent(link);
  while (at > other && parts_[at].empty()) at = parent(at);
  return at == other;
}

void ModelSampler::AddGapBetween(size_t link, size_t other) {
  const bool named = std::ranges::any_of(settings_.not_checked, [&](const auto& pair) {
    return std::minmax(pair.first, pair.second) == std::minmax(link, other);
  });
  const size_t joints = JointsBetween(link, other).size();
  if (named || (joints <= 1 && IsNextTo(link, other))) return;
  Gap gap{.link = link,
          .other = other,
          .kept = joints <= 2 ? settings_.clearance_of_near : settings_.clearance,
          .parts = {},
          .levers = std::vector<double>(joints_.size())};
  for (const size_t a : parts_[link]) {
    for (const size_t b : parts_[other]) {
      const std::vector<size_t> between =
          JointsBetween(robot_.parts()[a].moves_with, robot_.parts()[b].moves_with);
      if (between.empty()) continue;
      gap.parts.emplace_back(a, b);
      for (const size_t joint : between) {
        gap.levers[joint] =
            std::max(gap.levers[joint], robot_.Lever(a, joint) + robot_.Lever(b, joint));
      }
    }
  }
  if (!gap.parts.empty()) gaps_.push_back(std::move(gap));
}

void ModelSampler::AddGapToFace(size_t link, int face) {
  Gap gap{.link = link,
          .other = link,
          .face = face,
          .kept = settings_.clearance,
          .parts = {},
          .levers = std::vector<double>(joints_.size())};
  for (const size_t part : parts_[link]) {
    if (JointsBetween(robot_.parts()[part].moves_with, 0).empty()) continue;
    gap.parts.emplace_back(part, part);
    for (size_t joint = 0; joint < joints_.size(); ++joint) {
      gap.levers[joint] = std::max(gap.levers[joint], robot_.Lever(part, joint));
    }
  }
  if (!gap.parts.empty()) gaps_.push_back(std::move(gap));
}

NarrowGap ModelSampler::Narrow(const Gap& gap, double width) {
  return {.link = gap.link, .other = gap.other, .face = gap.face, .width = width, .kept = gap.kept};
}

void ModelSampler::LearnWhatIsNarrow() {
  std::vector<std::vector<double>> widths(gaps_.size());
  for (int i = 0; i < kLearnt; ++i) {
    Place(Any());
    for (size_t g = 0; g < gaps_.size(); ++g) {
      widths[g].push_back(Width(gaps_[g], 2 * gaps_[g].kept));
    }
  }
  for (size_t g = 0; g < gaps_.size(); ++g) {
    const auto median = widths[g].begin() + kLearnt / 2;
    std::ranges::nth_element(widths[g], median);
    gaps_[g].kept = std::max(kLeastKept, *median / 2);
    const double widest = std::ranges::max(widths[g]);
    if (widest < kLeastKept) always_narrow_.push_back(Narrow(gaps_[g], widest));
  }
}

Configuration ModelSampler::Any() {
  Configuration q;
  for (const GridJoint& joint : joints_) {
    q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random_));
  }
  return q;
}

void ModelSampler::Place(std::span<const double> q) {
  robot_.chain().Pose(q, poses_);
  robot_.balls().Place(poses_, {}, placed_);
}

bool ModelSampler::BallsAreApart(size_t part, size_t other, double enough) const {
  const PartBalls& balls = robot_.balls();
  return std::ranges::all_of(balls_[part], [&](size_t a) {
    return std::ranges::all_of(balls_[other], [&](size_t b) {
      const double x = placed_.x[a] - placed_.x[b];
      const double y = placed_.y[a] - placed_.y[b];
      const double z = placed_.z[a] - placed_.z[b];
      const double apart = balls.radius(a) + balls.radius(b) + placed_.growth[a] +
                           placed_.growth[b] + 2 * placed_.slack + enough;
      return x * x + y * y + z * z >= apart * apart;
    });
  });
}

double ModelSampler::PartsApart(size_t part, size_t other, double enough) const {
  if (BallsAreApart(part, other, enough)) return enough;
  const RobotPart& a = robot_.parts()[part];
  const RobotPart& b = robot_.parts()[other];
  const double radii =
      std::max(a.radius - settings_.tolerance, 0.0) + std::max(b.radius - settings_.tolerance, 0.0);
  const double distance =
      HullDistance(a.points, poses_[a.moves_with], b.points, poses_[b.moves_with], enough + radii);
  return distance < enough + radii ? distance - radii : enough;
}

double ModelSampler::WithinFace(size_t part, int face) const {
  const RobotPart& of = robot_.parts()[part];
  const Eigen::Isometry3d& pose = poses_[of.moves_with];
  const int axis = face % 3;
  const Eigen::RowVectorXd along = pose.linear().row(axis) * of.points;
  const double at = pose.translation()[axis];
  return (face < 3 ? along.minCoeff() + at - workspace_.min()[axis]
                   : workspace_.max()[axis] - along.maxCoeff() - at) -
         of.radius;
}

double ModelSampler::Width(const Gap& gap, double enough) const {
  double width = enough;
  for (const auto& [a, b] : gap.parts) {
    width = std::min(width, gap.face < 0 ? PartsApart(a, b, width) : WithinFace(a, gap.face));
  }
  return width;
}

bool ModelSampler::IsClear(std::span<const double> q, std::span<const Gap> gaps) {
  Place(q);
  return std::ranges::all_of(gaps,
                             [&](const Gap& gap) { return Width(gap, gap.kept) >= gap.kept; });
}

std::vector<NarrowGap> ModelSampler::NarrowGapsAt(std::span<const double> q) {
  Place(q);
  std::vector<NarrowGap> narrow;
  for (const Gap& gap : gaps_) {
    const double width = Width(gap, gap.kept);
    if (width >= gap.kept) continue;
    narrow.push_back(Narrow(gap, width));
  }
  std::ranges::sort(narrow, {}, &NarrowGap::width);
  return narrow;
}

std::optional<std::vector<ModelSampler::Gap>> ModelSampler::GapsFrom(std::span<const double> here) {
  std::vector<Gap> gaps = gaps_;
  Place(here);
  for (Gap& gap : gaps) {
    const double width = Width(gap, gap.kept + kGivesWay);
    if (width < kLeastKept) return std::nullopt;
    gap.kept = std::min(gap.kept, width - kGivesWay);
  }
  return gaps;
}

bool ModelSampler::Keeps(const Gap& gap, std::span<const double> from, std::span<const double> to) {
  double closes = 0;  // at most, all along
  for (size_t j = 0; j < from.size(); ++j) closes += gap.levers[j] * std::abs(to[j] - from[j]);
  Configuration q(from.size());
  for (double share = 0;;) {
    Interpolate(from, to, share, q);
    Place(q);
    const double width = Width(gap, gap.kept + kFar);
    if (width < gap.kept) return false;
    if (share == 1) return true;
    share = std::min(1.0, share + (width - gap.kept / 2) / closes);
  }
}

bool ModelSampler::IsClearWay(std::span<const double> from, std::span<const double> to,
                              std::span<const Gap> gaps) {
  if (forbidden_.Between(from, to)) return false;
  for (size_t j = 0; j < joints_.size(); ++j) {
    if (joints_[j].continuous && std::abs(to[j] - from[j]) >= std::numbers::pi) return false;
  }
  return std::ranges::all_of(gaps, [&](const Gap& gap) { return Keeps(gap, from, to); });
}

std::optional<Configuration> ModelSampler::Next(const Configuration& here) {
  const std::optional<std::vector<Gap>> gaps = GapsFrom(here);
  if (!gaps) return std::nullopt;
  for (int i = 0; i < settings_.most_tries; ++i) {
    Configuration q = Any();
    if (IsClear(q) && IsClearWay(here, q, *gaps)) return q;
  }
  return std::nullopt;
}

}  // namespace silhouette
