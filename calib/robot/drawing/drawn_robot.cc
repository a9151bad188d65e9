// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_robot.h"

#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

const Eigen::Isometry3d& PoseFor(const RobotPart& part,
                                 std::span<const Eigen::Isometry3d> base_from_link) {
  if (part.moves_with >= base_from_link.size()) throw std::out_of_range("a link has no pose");
  return base_from_link[part.moves_with];
}

}  // namespace

DrawnRobot::DrawnRobot(std::vector<RobotPart> parts, std::vector<PartDrawer> views)
    : parts_(std::move(parts)), views_(std::move(views)) {
  if (parts_.empty()) throw std::invalid_argument("a robot without parts cannot be drawn");
  for (const RobotPart& part : parts_) {
    if (part.points.cols() == 0) throw std::invalid_argument("a part of the robot has no points");
  }
}

void DrawnRobot::AddTouched(size_t view, std::span<const Eigen::Isometry3d> base_from_link,
                            double growth, DrawingScratch& scratch,
                            std::span<uint64_t> words) const {
  for (const RobotPart& part : parts_) {
    views_[view].AddTouched(PoseFor(part, base_from_link), part.points, part.radius + growth,
                            scratch, words);
  }
}

void DrawnRobot::AddCovered(size_t view, std::span<const Eigen::Isometry3d> base_from_link,
                            DrawingScratch& scratch, std::span<uint64_t> words) const {
  for (const RobotPart& part : parts_) {
    if (part.inner.cols() == 0) continue;
    views_[view].AddCovered(PoseFor(part, base_from_link), part.inner, scratch, words);
  }
}

Mask DrawnRobot::Touched(size_t view, std::span<const Eigen::Isometry3d> base_from_link,
                         double growth) const {
  DrawingScratch scratch;
  std::vector<uint64_t> words(views_.at(view).size().words());
  AddTouched(view, base_from_link, growth, scratch, words);
  return Mask::FromWords(views_[view].size(), std::move(words));
}

Mask DrawnRobot::Covered(size_t view, std::span<const Eigen::Isometry3d> base_from_link) const {
  DrawingScratch scratch;
  std::vector<uint64_t> words(views_.at(view).size().words());
  AddCovered(view, base_from_link, scratch, words);
  return Mask::FromWords(views_[view].size(), std::move(words));
}

}  // namespace silhouette
