// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/truth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "calib/robot/drawing/motion_check.h"
#include "calib/robot/parts.h"
#include "db/mask/interpolation.h"

namespace silhouette::people_experiment {
namespace {

// Metres that the robot's points move at most from place to place where its speed is looked at.
constexpr double kPiece = 0.05;

// The corners of the box that grows to the shape; of a capsule two.
Eigen::Matrix3Xd PointsOf(const Shape& shape) {
  Eigen::Matrix3Xd points(3, shape.half.x() > 0 ? 8 : 2);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d sign((i & 4) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 1) != 0 ? 1 : -1);
    points.col(i) = shape.half.cwiseProduct(sign);
  }
  return points;
}

// Calls `flip` for each of `pixels`, with the probability `share`.
template <typename Flip>
void Flips(size_t pixels, double share, Chance& chance, Flip flip) {
  if (share <= 0) return;
  const double scale = 1 / std::log1p(-share);
  for (double pixel = std::floor(std::log(chance.Uniform()) * scale);
       pixel < static_cast<double>(pixels);
       pixel += 1 + std::floor(std::log(chance.Uniform()) * scale)) {
    flip(static_cast<size_t>(pixel));
  }
}

}  // namespace

absl::StatusOr<DrawnRobot> TrueRobot(const SimulatedWorkplace& workplace,
                                     std::span<const MaskSize> sizes) {
  std::vector<std::string> moving;
  for (const GridJoint& joint : workplace.cell().grid.joints()) moving.push_back(joint.name);
  return DrawnRobotOf(workplace.robot(), {.tolerance = 0}, moving, workplace.cell().fixed_joints,
                      workplace.TrueCalibration(), sizes, 0);
}

double FastestMovement(const DrawnRobot& robot, std::span<const double> from,
                       std::span<const double> to) {
  const double steps = std::max(1.0, std::ceil(GreatestDisplacement(robot, from, to) / kPiece));
  std::vector<Eigen::Isometry3d> before;
  std::vector<Eigen::Isometry3d> poses;
  robot.chain().Pose(from, before);
  double farthest = 0;
  Configuration q(from.size());
  for (double step = 1; step <= steps; ++step) {
    Interpolate(from, to, step / steps, q);
    robot.chain().Pose(q, poses);
    farthest = std::max(farthest, DisplacementBetween(robot, before, poses));
    before.swap(poses);
  }
  return farthest * steps;
}

Truth::Truth(const SimulatedWorkplace& workplace, const DrawnRobot& robot, size_t people)
    : workplace_(workplace),
      robot_(robot),
      contact_(workplace.robot(), PeopleObstacles(static_cast<int>(people))) {}

void Truth::Set(std::span<const Person> people, std::span<const double> times) {
  parts_.clear();
  obstacles_.clear();
  for (size_t i = 0; i < people.size(); ++i) {
    for (const PlacedShape& part : people[i].PartsAt(times[i])) parts_.push_back(part);
    people[i].AppendPoses(times[i], obstacles_);
  }
}

double Truth::AtLeast(std::span<const double> q) {
  const PartBalls& balls = robot_.balls();
  robot_.chain().Pose(q, links_);
  balls.Place(links_, {}, balls_);
  double least = std::numeric_limits<double>::infinity();
  for (const PlacedShape& part : parts_) {
    const Eigen::Isometry3d shape_from_world = part.world_from_shape.inverse();
    const Eigen::AlignedBox3d box(-part.shape.half, part.shape.half);
    for (size_t ball = 0; ball < balls.balls(); ++ball) {
      const Eigen::Vector3d centre(balls_.x[ball], balls_.y[ball], balls_.z[ball]);
      const double radius = double{balls.radius(ball)} + balls_.growth[ball] + part.shape.radius;
      least = std::min(least, box.exteriorDistance(shape_from_world * centre) - radius);
    }
  }
  return std::max(0.0, least);
}

double Truth::Distance(std::span<const double> q, double limit) {
  const double least = AtLeast(q);
  if (least >= limit) return least;
  return contact_.Check(workplace_.LinkPoses(q), obstacles_).distance;
}

Mask TrueMasks::RobotMask(size_t view, std::span<const double> q) {
  const MaskSize size = robot_.views()[view].size();
  std::vector<uint64_t> words(size.words());
  robot_.AddTouched(view, links_, {}, scratch_, words);
  Mask mask = Mask::FromWords(size, std::move(words));
  if (captured_ == nullptr) return mask;
  Mask any(size);
  Mask all = ~any;
  const CellCorners corners = captured_->grid().CornersAround(q);
  for (const ConfigurationNumber corner : corners.numbers()) {
    const auto images = captured_->Images(corner);
    if (!images) return mask;
    any = any | (*images)[view];
    all = all & (*images)[view];
  }
  return (mask & any) | all;
}

std::vector<Mask> TrueMasks::Draw(std::span<const double> q, std::span<const PlacedShape> people,
                                  Chance& chance) {
  robot_.chain().Pose(q, links_);
  std::vector<Mask> masks;
  for (size_t view = 0; view < robot_.views().size(); ++view) {
    const PartDrawer& drawer = robot_.views()[view];
    const MaskSize size = drawer.size();
    std::vector<uint64_t> words(size.words());
    for (const PlacedShape& part : people) {
      drawer.AddTouched(part.world_from_shape, PointsOf(part.shape), {}, part.shape.radius,
                        scratch_, words);
    }
    const auto bit = [](size_t pixel) { return uint64_t{1} << (pixel % 64); };
    Flips(size.pixels(), errors_.missed, chance,
          [&](size_t pixel) { words[pixel / 64] &= ~bit(pixel); });
    Flips(size.pixels(), errors_.added, chance,
          [&](size_t pixel) { words[pixel / 64] |= bit(pixel); });
    masks.push_back(Mask::FromWords(size, std::move(words)) | RobotMask(view, q));
  }
  return masks;
}

}  // namespace silhouette::people_experiment
