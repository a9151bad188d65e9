// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/drawn_checker.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

// Of a ball's radius: a part that is grown by more is nearly as round, and dear to draw.
constexpr double kAsBall = 0.5;

using Candidate = DrawnCheckScratch::Candidate;
using OpenView = DrawnCheckScratch::OpenView;

// The first and the last row with a pixel.
std::pair<int, int> RowsOf(const Mask& mask) {
  const auto is_empty = [&mask](int y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (mask.at(x, y)) return false;
    }
    return true;
  };
  int first = 0;
  int last = mask.height() - 1;
  while (first < last && is_empty(first)) ++first;
  while (last > first && is_empty(last)) --last;
  return {first, last};
}

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
    plane.rows = RowsOf(*shown[view]);
    plane.mask = *std::move(shown[view]);
  }
}

bool DrawnChecker::Look(const OpenView& near_view, Growth growth,
                        DrawnCheckScratch& scratch) const {
  const PartBalls& balls = robot_->balls();
  const size_t view = near_view.view;
  const size_t begin = scratch.candidates.size();
  if (!robot_->looks()[view].bounded()) {
    for (size_t part = 0; part < robot_->parts().size(); ++part) {
      scratch.candidates.push_back({view, part, 0});
    }
    return false;
  }
  for (size_t i = near_view.begin; i < near_view.end; ++i) {
    SeenBalls& vector = scratch.seen[i];
    robot_->looks()[view].See(balls, scratch.balls, planes_[view].distances, vector);
    for (uint32_t near = vector.near; near != 0; near &= near - 1) {
      const auto lane = static_cast<size_t>(std::countr_zero(near));
      const size_t ball = BallNumbers::kLanes * vector.vector + lane;
      const auto pixel = static_cast<uint32_t>(vector.pixel[lane]);
      const int distance = planes_[view].distances.UnitsAt(pixel / 2);
      const size_t part = balls.part(ball);
      const bool as_ball =
          !growth.empty() && growth[part] > kAsBall * static_cast<double>(balls.radius(ball));
      if (as_ball || (distance == 0 && pixel % 2 == 1)) {
        scratch.candidates.resize(begin);
        return true;
      }
      const int depth = vector.reach[lane] - distance;
      // Balls of a part stand together.
      if (scratch.candidates.size() > begin && scratch.candidates.back().part == part) {
        int& deepest = scratch.candidates.back().depth;
        deepest = std::max(deepest, depth);
      } else {
        scratch.candidates.push_back({view, part, depth});
      }
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
      planes_[candidate.view].mask.words(), planes_[candidate.view].rows);
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
  scratch.seen.clear();
  scratch.near.clear();
  for (size_t view = 0; view < planes_.size(); ++view) {
    if (planes_[view].mask.words().empty()) continue;
    const BallLook& look = robot_->looks()[view];
    const size_t before = scratch.seen.size();
    if (look.bounded()) {
      look.FindNear(robot_->balls(), scratch.balls, planes_[view].distances, scratch.seen);
    }
    const size_t end = scratch.seen.size();
    if (look.bounded() && end == before) continue;
    scratch.near.push_back({view, before, end, static_cast<int>(end - before)});
  }
  int showing = missing_;
  auto after = static_cast<int>(scratch.near.size());  // views still to be looked at or drawn
  const auto undecided = [&] {
    return showing < enough && (showing + after >= enough || (any_counts && showing == 0));
  };
  scratch.candidates.clear();
  scratch.open.clear();
  std::ranges::sort(scratch.near, std::greater(), &OpenView::order);
  for (const OpenView& near : scratch.near) {
    if (!undecided()) break;
    const size_t before = scratch.candidates.size();
    const bool shown = Look(near, growth, scratch);
    if (!shown && scratch.candidates.size() > before) {
      // What reaches farthest into the plane first: most likely it meets it.
      const auto candidates = std::span(scratch.candidates).subspan(before);
      std::ranges::sort(candidates, std::greater(), &Candidate::depth);
      scratch.open.push_back({near.view, before, scratch.candidates.size(), candidates[0].depth});
      continue;
    }
    --after;
    if (shown) ++showing;
  }
  std::ranges::sort(scratch.open, std::less(), &OpenView::order);
  std::span<const OpenView> open = scratch.open;
  while (!open.empty() && undecided()) {
    // The first view that shows an obstacle, then others that show none decide most.
    const OpenView view = showing == 0 ? open.back() : open.front();
    open = showing == 0 ? open.first(open.size() - 1) : open.subspan(1);
    --after;
    for (size_t i = view.begin; i < view.end; ++i) {
      if (!IsMet(scratch.candidates[i], growth, scratch)) continue;
      ++showing;
      break;
    }
  }
  return std::min(enough, showing);
}

}  // namespace silhouette
