// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/drawn_space.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/robot/drawing/drawn_places.h"
#include "calib/robot/drawing/motion_check.h"
#include "clients/cpp/motion_in_map.h"
#include "db/mask/interpolation.h"
#include "silhouette/messages.h"

namespace silhouette::client {
namespace {

// The server's bound of the checks that a path takes.
constexpr int64_t kMostChecks = 1'000'000;

}  // namespace

absl::StatusOr<std::shared_ptr<const DrawnSpace>> DrawnSpace::FromMessage(
    std::shared_ptr<const ServedRobot> robot, const v1::WatchConfigurationSpaceResponse& update) {
  const auto views = static_cast<int>(robot->views.size());
  if (update.planes_size() != views) {
    return absl::InternalError(
        absl::StrCat("an update has ", update.planes_size(), " planes of ", views, " views"));
  }
  if (update.min_views() < 1 || update.min_views() > views) {
    return absl::InternalError(
        absl::StrCat("min_views is ", update.min_views(), ", and there are ", views, " views"));
  }
  try {
    std::vector<std::optional<Mask>> planes;
    for (const v1::ObstaclePlane& plane : update.planes()) {
      if (plane.view() != robot->views[planes.size()] || plane.missing() == plane.has_mask()) {
        throw std::invalid_argument("'" + plane.view() + "' is not a plane of the robot's view");
      }
      planes.push_back(plane.missing() ? std::nullopt
                                       : std::optional(client::FromMessage(plane.mask())));
    }
    return std::shared_ptr<const DrawnSpace>(
        new DrawnSpace(std::move(robot), std::move(planes), update.min_views()));
  } catch (const std::invalid_argument& error) {
    return absl::InternalError(absl::StrCat("the planes cannot be: ", error.what()));
  }
}

DrawnSpace::DrawnSpace(std::shared_ptr<const ServedRobot> robot,
                       std::vector<std::optional<Mask>> planes, int min_views)
    : robot_(std::move(robot)),
      view_missing_(
          !std::ranges::all_of(planes, [](const auto& plane) { return plane.has_value(); })),
      min_views_(min_views),
      checker_(robot_->robot, std::move(planes)) {}

Verdict DrawnSpace::Judge(std::span<const double> q, Growth growth, std::span<const double> from,
                          std::span<const double> to) const {
  switch (DrawnPlaceBetween(robot_->robot->chain(), robot_->grid, robot_->forbidden, from, to)) {
    case DrawnPlace::kOpen:
      break;
    case DrawnPlace::kForbidden:
      return {.reason = Reason::kExcluded};
    case DrawnPlace::kOutside:
      return {.reason = Reason::kOutsideGrid};
  }
  thread_local DrawnCheckScratch scratch;
  if (checker_.ShownBy(min_views_, q, growth, scratch)) return {.state = State::kOccupied};
  if (view_missing_) return {.reason = Reason::kViewMissing};
  return {.state = State::kFree};
}

bool DrawnSpace::IsOutside(std::span<const double> q) const {
  return DrawnPlaceBetween(robot_->robot->chain(), robot_->grid, {}, q, q) == DrawnPlace::kOutside;
}

bool DrawnSpace::FreeByNode(std::span<const double> q, const SpaceMap& map) const {
  if (!map.grid.has_any()) return false;
  const std::optional<ConfigurationNumber> node = map.grid.Nearest(q);
  return node && map.StateAt(*node) == State::kFree &&
         DrawnPlaceBetween(robot_->robot->chain(), robot_->grid, robot_->forbidden, q, q) ==
             DrawnPlace::kOpen;
}

Verdict DrawnSpace::Check(std::span<const double> q, const SpaceMap& map) const {
  if (FreeByNode(q, map)) return {.state = State::kFree};
  return Judge(q, {}, q, q);
}

MotionVerdict DrawnSpace::CheckMotion(std::span<const double> from, std::span<const double> to,
                                      double path_resolution) const {
  MotionVerdict result;
  // Whether it is free, which is so of the whole stretch between two places.
  const auto note = [&](const MotionPlace& place, std::span<const double> first,
                        std::span<const double> last) {
    ++result.checked;
    const Verdict verdict = Judge(place.q, place.growth, first, last);
    if (verdict.free()) {
      result.last_free = place.growth.empty() ? place.fraction : place.last;
      return true;
    }
    if (!place.growth.empty()) return false;
    result.state = verdict.state;
    result.reason = verdict.reason;
    result.fraction = place.fraction;
    std::copy_n(place.q.begin(), std::min(place.q.size(), result.place.size()),
                result.place.begin());
    return false;
  };
  if (!note({.q = from, .growth = {}}, from, from)) return result;
  if (!IsOutside(to)) {
    Configuration first(from.size());
    Configuration last(from.size());
    bool stopped = false;
    const auto is_free = [&](const MotionPlace& place) {
      stopped = stopped || result.checked > kMostChecks;
      if (stopped) return false;
      Interpolate(from, to, place.first, first);
      Interpolate(from, to, place.last, last);
      return note(place, first, last);
    };
    const auto motion = silhouette::CheckMotion(*robot_->robot, from, to, path_resolution, is_free);
    if (stopped) return UnknownMotion(Reason::kNotCheckedHere, from);
    if (!motion.free) return result;
    result.sampled_step = motion.sampled_step;
  }
  if (!note({.q = to, .growth = {}, .fraction = 1}, to, to)) {
    result.sampled_step = 0;
    return result;
  }
  result.state = State::kFree;
  result.proof = result.sampled_step > 0 ? PathProof::kSampled : PathProof::kContinuous;
  return result;
}

}  // namespace silhouette::client
