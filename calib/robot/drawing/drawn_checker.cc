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

using Candidate = DrawnCheckScratch::Candidate;
using NearView = DrawnCheckScratch::NearView;
using OpenView = DrawnCheckScratch::OpenView;

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
    std::optional<Plane>& plane = planes_.emplace_back();
    if (!shown[view]) {
      ++missing_;
      continue;
    }
    if (shown[view]->size() != robot_->views()[view].size()) {
      throw std::invalid_argument("a plane has not the size of the view");
    }
    if (shown[view]->Empty()) continue;
    plane.emplace(Plane{PlaneDistances(*shown[view]), DrawnPlane(*std::move(shown[view]))});
  }
}

bool DrawnChecker::Look(size_t view, DrawnCheckScratch& scratch) const {
  const BallLook& look = robot_->looks()[view];
  if (!look.bounded()) return false;
  const PartBalls& balls = robot_->balls();
  const size_t begin = scratch.seen.size();
  for (size_t group = 0; group < balls.groups(); ++group) {
    for (uint32_t near = scratch.near_groups[view * balls.groups() + group]; near != 0;
         near &= near - 1) {
      const auto lane = static_cast<size_t>(std::countr_zero(near));
      SeenBalls& seen = scratch.seen.emplace_back();
      seen.vector = BallNumbers::kLanes * group + lane;
      look.See(balls, scratch.balls, planes_[view]->distances, seen);
      if (seen.shown != 0 || (seen.near & scratch.balls.grown[seen.vector]) != 0) {
        scratch.seen.resize(begin);
        return true;
      }
      if (seen.near == 0) scratch.seen.pop_back();
    }
  }
  return false;
}

bool DrawnChecker::IsMet(const OpenView& open, Growth growth, DrawnCheckScratch& scratch) const {
  const PartBalls& balls = robot_->balls();
  std::vector<Candidate>& candidates = scratch.candidates;
  candidates.clear();
  for (const SeenBalls& seen : std::span(scratch.seen).subspan(open.begin, open.end - open.begin)) {
    for (uint32_t near = seen.near; near != 0; near &= near - 1) {
      const auto lane = static_cast<size_t>(std::countr_zero(near));
      const size_t part = balls.part(BallNumbers::kLanes * seen.vector + lane);
      // Balls of a part stand together.
      if (candidates.empty() || candidates.back().part != part) candidates.push_back({part, 0});
      candidates.back().depth = std::max(candidates.back().depth, seen.depth[lane]);
    }
  }
  if (!robot_->looks()[open.view].bounded()) {
    for (size_t part = 0; part < robot_->parts().size(); ++part) candidates.push_back({part, 0});
  }
  // What reaches farthest into the plane first: most likely it meets it.
  std::ranges::sort(candidates, std::greater(), &Candidate::depth);
  const DrawnPlane& plane = planes_[open.view]->pixels;
  return std::ranges::any_of(candidates, [&](const Candidate& candidate) {
    const RobotPart& part = robot_->parts()[candidate.part];
    return robot_->views()[open.view].Meets(
        scratch.base_from_link[part.moves_with], part.points, robot_->edges()[candidate.part],
        part.radius + (growth.empty() ? 0 : growth[candidate.part]), scratch.drawing, plane);
  });
}

int DrawnChecker::Showing(std::span<const double> q, Growth growth, int enough,
                          DrawnCheckScratch& scratch) const {
  return Count(q, growth, enough, growth.empty(), scratch);
}

bool DrawnChecker::ShownBy(int views, std::span<const double> q, Growth growth,
                           DrawnCheckScratch& scratch) const {
  return Count(q, growth, views, /*any_counts=*/false, scratch) >= views;
}

void DrawnChecker::FindNear(DrawnCheckScratch& scratch) const {
  const PartBalls& balls = robot_->balls();
  const size_t groups = balls.groups();
  scratch.near_groups.resize(planes_.size() * groups);
  scratch.near.clear();
  for (size_t view = 0; view < planes_.size(); ++view) {
    if (!planes_[view]) continue;
    const BallLook& look = robot_->looks()[view];
    const auto near = std::span(scratch.near_groups).subspan(view * groups, groups);
    const int vectors =
        look.bounded() ? look.FindNear(balls, scratch.balls, planes_[view]->distances, near) : 0;
    scratch.near.push_back({view, vectors});
  }
  // After all views are looked at: until then, the processor works on several at a time.
  std::erase_if(scratch.near, [&](const NearView& near) {
    return near.vectors == 0 && robot_->looks()[near.view].bounded();
  });
  std::ranges::sort(scratch.near, std::greater(), &NearView::vectors);
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
  FindNear(scratch);
  int showing = missing_;
  auto after = static_cast<int>(scratch.near.size());  // views still to be looked at or drawn
  const auto undecided = [&] {
    return showing < enough && (showing + after >= enough || (any_counts && showing == 0));
  };
  scratch.seen.clear();
  scratch.open.clear();
  for (const NearView& near : scratch.near) {
    if (!undecided()) break;
    const size_t begin = scratch.seen.size();
    const bool shown = Look(near.view, scratch);
    const auto seen = std::span(scratch.seen).subspan(begin);
    if (!shown && (!seen.empty() || !robot_->looks()[near.view].bounded())) {
      int depth = 0;
      for (const SeenBalls& balls : seen)
        depth = std::max(depth, *std::ranges::max_element(balls.depth));
      scratch.open.push_back({near.view, begin, scratch.seen.size(), depth});
      continue;
    }
    --after;
    if (shown) ++showing;
  }
  std::ranges::sort(scratch.open, std::less(), &OpenView::depth);
  std::span<const OpenView> open = scratch.open;
  while (!open.empty() && undecided()) {
    // The first view that shows an obstacle, then others that show none decide most.
    const OpenView& view = showing == 0 ? open.back() : open.front();
    open = showing == 0 ? open.first(open.size() - 1) : open.subspan(1);
    --after;
    if (IsMet(view, growth, scratch)) ++showing;
  }
  return std::min(enough, showing);
}

}  // namespace silhouette
