// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_robot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace silhouette {

DrawnRobot::DrawnRobot(KinematicChain chain, std::vector<RobotPart> parts,
                       std::vector<PartDrawer> views)
    : chain_(std::move(chain)),
      parts_(std::move(parts)),
      views_(std::move(views)),
      joints_(chain_.joints().size()) {
  if (parts_.empty()) throw std::invalid_argument("a robot without parts cannot be drawn");
  for (const RobotPart& part : parts_) {
    if (part.points.cols() == 0) throw std::invalid_argument("a part of the robot has no points");
    if (!part.points.allFinite() || !std::isfinite(part.radius) || part.radius < 0) {
      throw std::invalid_argument("a part of the robot has no finite size");
    }
    if (part.moves_with >= chain_.links().size()) {
      throw std::invalid_argument("a part of the robot is of no link");
    }
    edges_.emplace_back(part.points);
    const double reach = part.points.colwise().norm().maxCoeff() + part.radius;
    for (size_t joint = 0; joint < joints_; ++joint) {
      levers_.push_back(chain_.LeverOf(joint, part.moves_with, reach));
    }
  }
  balls_ = PartBalls(parts_, edges_);
  for (const PartDrawer& view : views_) looks_.emplace_back(view);
}

bool DrawnRobot::Leaves(const Eigen::AlignedBox3d& box,
                        std::span<const Eigen::Isometry3d> base_from_link, Growth growth) const {
  for (size_t i = 0; i < parts_.size(); ++i) {
    const std::span<const double> levers = std::span(levers_).subspan(i * joints_, joints_);
    if (std::ranges::none_of(levers, [](double lever) { return lever > 0; })) continue;
    const double radius = parts_[i].radius + (growth.empty() ? 0 : growth[i]);
    const Eigen::Isometry3d& pose = base_from_link[parts_[i].moves_with];
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::RowVectorXd along = pose.linear().row(axis) * parts_[i].points;
      const double origin = pose.translation()[axis];
      if (!(origin + along.minCoeff() - radius >= box.min()[axis] &&
            origin + along.maxCoeff() + radius <= box.max()[axis])) {
        return true;
      }
    }
  }
  return false;
}

void DrawnRobot::AddTouched(size_t view, std::span<const Eigen::Isometry3d> base_from_link,
                            Growth growth, DrawingScratch& scratch,
                            std::span<uint64_t> words) const {
  if (!growth.empty() && growth.size() != parts_.size()) {
    throw std::invalid_argument("not a growth for each part");
  }
  for (size_t i = 0; i < parts_.size(); ++i) {
    views_[view].AddTouched(base_from_link[parts_[i].moves_with], parts_[i].points, edges_[i],
                            parts_[i].radius + (growth.empty() ? 0 : growth[i]), scratch, words);
  }
}

void DrawnRobot::AddCovered(size_t view, std::span<const Eigen::Isometry3d> base_from_link,
                            DrawingScratch& scratch, std::span<uint64_t> words) const {
  for (const RobotPart& part : parts_) {
    if (part.inner.cols() == 0) continue;
    views_[view].AddCovered(base_from_link[part.moves_with], part.inner, scratch, words);
  }
}

std::vector<Mask> DrawnRobot::Touched(std::span<const double> q, double growth) const {
  DrawingScratch scratch;
  std::vector<Eigen::Isometry3d> base_from_link;
  chain_.Pose(q, base_from_link);
  const std::vector<double> all(parts_.size(), growth);
  std::vector<Mask> masks;
  for (size_t view = 0; view < views_.size(); ++view) {
    std::vector<uint64_t> words(views_[view].size().words());
    AddTouched(view, base_from_link, all, scratch, words);
    masks.push_back(Mask::FromWords(views_[view].size(), std::move(words)));
  }
  return masks;
}

std::vector<Mask> DrawnRobot::Covered(std::span<const double> q) const {
  DrawingScratch scratch;
  std::vector<Eigen::Isometry3d> base_from_link;
  chain_.Pose(q, base_from_link);
  std::vector<Mask> masks;
  for (size_t view = 0; view < views_.size(); ++view) {
    std::vector<uint64_t> words(views_[view].size().words());
    AddCovered(view, base_from_link, scratch, words);
    masks.push_back(Mask::FromWords(views_[view].size(), std::move(words)));
  }
  return masks;
}

}  // namespace silhouette
