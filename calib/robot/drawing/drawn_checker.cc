// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_checker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

// Of a ball's radius: a part that is grown by more is nearly as round, and dear to draw.
constexpr double kAsBall = 0.5;
constexpr float kUnknownDepth = std::numeric_limits<float>::infinity();

using Candidate = DrawnCheckScratch::Candidate;

void RequireGrowth(Growth growth, size_t parts) {
  if (growth.empty()) return;
  if (growth.size() != parts) throw std::invalid_argument("not a growth for each part");
  for (const double part : growth) {
    if (!(part >= 0) || !std::isfinite(part)) {
      throw std::invalid_argument("a body cannot grow by less than nothing");
    }
  }
}

}  // namespace

DrawnChecker::DrawnChecker(std::shared_ptr<const DrawnRobot> robot,
                           std::vector<std::optional<Mask>> shown)
    : robot_(std::move(robot)) {
  if (robot_ == nullptr) throw std::invalid_argument("there is no robot to draw");
  if (shown.size() != robot_->views().size()) {
    throw std::invalid_argument("not a plane for each view of the robot");
  }
  for (size_t view = 0; view < shown.size(); ++view) {
    Plane& plane = planes_.emplace_back();
    if (!shown[view]) {
      ++missing_;
      continue;
    }
    if (shown[view]->size() != robot_->views()[view].size()) {
      throw std::invalid_argument("a plane has not the size of the view");
    }
    if (shown[view]->Empty()) continue;
    plane.distances = PlaneDistances(*shown[view]);
    plane.mask = *std::move(shown[view]);
    ++filled_;
  }
}

bool DrawnChecker::Look(size_t view, Growth growth, DrawnCheckScratch& scratch) const {
  const PartBalls& balls = robot_->balls();
  const size_t begin = scratch.candidates.size();
  if (!robot_->looks()[view].bounded()) {
    for (size_t part = 0; part < robot_->parts().size(); ++part) {
      scratch.candidates.push_back({view, part, 0});
    }
    return false;
  }
  robot_->looks()[view].See(balls, scratch.balls, planes_[view].distances, scratch.seen);
  for (const auto& [ball, reach, distance, in_pixel] : scratch.seen) {
    const size_t part = balls.part(ball);
    const bool as_ball =
        !growth.empty() && growth[part] > kAsBall * static_cast<double>(balls.radius(ball));
    if (as_ball || (distance == 0 && in_pixel)) {
      scratch.candidates.resize(begin);
      return true;
    }
    // Not a number, which has no order: not known.
    const float depth = std::isnan(reach) ? kUnknownDepth : reach - distance;
    // Balls of a part stand together.
    if (scratch.candidates.size() > begin && scratch.candidates.back().part == part) {
      float& deepest = scratch.candidates.back().depth;
      deepest = std::max(deepest, depth);
    } else {
      scratch.candidates.push_back({view, part, depth});
    }
  }
  return false;
}

bool DrawnChecker::IsMet(const Candidate& candidate, Growth growth,
                         DrawnCheckScratch& scratch) const {
  const RobotPart& part = robot_->parts()[candidate.part];
  return robot_->views()[candidate.view].Meets(
      scratch.base_from_link[part.moves_with], part.points, robot_->edges()[candidate.part],
      part.radius + (growth.empty() ? 0 : growth[candidate.part]), scratch.drawing,
      planes_[candidate.view].mask.words());
}

int DrawnChecker::Showing(std::span<const double> q, Growth growth, int enough,
                          DrawnCheckScratch& scratch) const {
  return Count(q, growth, enough, growth.empty(), scratch);
}

bool DrawnChecker::ShownBy(int views, std::span<const double> q, Growth growth,
                           DrawnCheckScratch& scratch) const {
  return Count(q, growth, views, /*any_counts=*/false, scratch) >= views;
}

int DrawnChecker::Count(std::span<const double> q, Growth growth, int enough, bool any_counts,
                        DrawnCheckScratch& scratch) const {
  if (enough < 1) throw std::invalid_argument("no view is not enough");
  RequireGrowth(growth, robot_->parts().size());
  robot_->chain().Pose(q, scratch.base_from_link);
  if (!std::ranges::all_of(q, [](double value) { return std::isfinite(value); })) {
    return std::min(enough, static_cast<int>(planes_.size()));
  }
  robot_->balls().Place(scratch.base_from_link, growth, scratch.balls);
  scratch.candidates.clear();
  int showing = missing_;
  int open = 0;         // views
  int after = filled_;  // views still to be looked at
  for (size_t view = 0; view < planes_.size() && showing < enough; ++view) {
    if (planes_[view].mask.words().empty()) continue;
    if (!any_counts && showing + open + after < enough) return std::min(enough, showing);
    --after;
    const size_t before = scratch.candidates.size();
    if (Look(view, growth, scratch)) {
      ++showing;
    } else if (scratch.candidates.size() > before) {
      ++open;
    }
  }
  for (size_t i = 0; i < scratch.candidates.size();) {
    const bool open_counts = showing + open >= enough || (any_counts && showing == 0);
    if (showing >= enough || !open_counts) break;
    const size_t view = scratch.candidates[i].view;
    size_t end = i;
    while (end < scratch.candidates.size() && scratch.candidates[end].view == view) ++end;
    // What reaches farthest into the plane first: most likely it meets it.
    std::sort(scratch.candidates.begin() + static_cast<std::ptrdiff_t>(i),
              scratch.candidates.begin() + static_cast<std::ptrdiff_t>(end),
              [](const Candidate& a, const Candidate& b) { return a.depth > b.depth; });
    --open;
    for (; i < end; ++i) {
      if (!IsMet(scratch.candidates[i], growth, scratch)) continue;
      ++showing;
      break;
    }
    i = end;
  }
  return std::min(enough, showing);
}

}  // namespace silhouette
