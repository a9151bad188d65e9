// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_checker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace silhouette {

DrawnChecker::DrawnChecker(std::shared_ptr<const DrawnRobot> robot,
                           std::vector<std::optional<Mask>> shown)
    : robot_(std::move(robot)) {
  if (robot_ == nullptr) throw std::invalid_argument("there is no robot to draw");
  if (shown.size() != robot_->views().size()) {
    throw std::invalid_argument("not a plane for each view of the robot");
  }
  for (size_t view = 0; view < shown.size(); ++view) {
    if (shown[view] && shown[view]->size() != robot_->views()[view].size()) {
      throw std::invalid_argument("a plane has not the size of the view");
    }
    if (!shown[view]) ++missing_;
    planes_.push_back(std::move(shown[view]).value_or(Mask()));
  }
}

bool DrawnChecker::Shows(size_t view, Growth growth, DrawnCheckScratch& scratch) const {
  const Mask& plane = planes_[view];
  scratch.words.assign(plane.words().size(), 0);
  robot_->AddTouched(view, scratch.base_from_link, growth, scratch.drawing, scratch.words);
  return Intersects(plane.words(), scratch.words);
}

int DrawnChecker::Showing(std::span<const double> q, Growth growth, int enough,
                          DrawnCheckScratch& scratch) const {
  if (enough < 1) throw std::invalid_argument("no view is not enough");
  if (!growth.empty() && growth.size() != robot_->parts().size()) {
    throw std::invalid_argument("not a growth for each part");
  }
  robot_->chain().Pose(q, scratch.base_from_link);
  if (!std::ranges::all_of(q, [](double value) { return std::isfinite(value); })) {
    return std::min(enough, static_cast<int>(planes_.size()));
  }
  int showing = missing_;
  for (size_t view = 0; view < planes_.size() && showing < enough; ++view) {
    if (planes_[view].words().empty()) continue;
    if (Shows(view, growth, scratch)) ++showing;
  }
  return std::min(showing, enough);
}

}  // namespace silhouette
