// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_robot.h"

#include <stdexcept>
#include <utility>

namespace silhouette {

DrawnRobot::DrawnRobot(KinematicChain chain, std::vector<RobotPart> parts,
                       std::vector<PartDrawer> views)
    : chain_(std::move(chain)), parts_(std::move(parts)), views_(std::move(views)) {
  if (parts_.empty()) throw std::invalid_argument("a robot without parts cannot be drawn");
  for (const RobotPart& part : parts_) {
    if (part.points.cols() == 0) throw std::invalid_argument("a part of the robot has no points");
    if (part.moves_with >= chain_.links().size()) {
      throw std::invalid_argument("a part of the robot is of no link");
    }
  }
}

void DrawnRobot::AddTouched(size_t view, std::span<const Eigen::Isometry3d> base_from_link,
                            double growth, DrawingScratch& scratch,
                            std::span<uint64_t> words) const {
  for (const RobotPart& part : parts_) {
    views_[view].AddTouched(base_from_link[part.moves_with], part.points, part.radius + growth,
                            scratch, words);
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
  std::vector<Mask> masks;
  for (size_t view = 0; view < views_.size(); ++view) {
    std::vector<uint64_t> words(views_[view].size().words());
    AddTouched(view, base_from_link, growth, scratch, words);
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
