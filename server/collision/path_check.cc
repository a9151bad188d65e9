// SPDX-License-Identifier: Apache-2.0
// CollisionChecker::CheckPath.
#include <algorithm>
#include <optional>
#include <stdexcept>

#include "db/mask/interpolation.h"
#include "db/mask/segment_places.h"
#include "server/collision/collision_checker.h"

namespace silhouette {
namespace {

void EndAt(std::span<const double> q, size_t segment, double fraction, const Verdict& verdict,
           PathVerdict& result) {
  result.verdict = verdict;
  result.segment = static_cast<int>(segment);
  result.fraction = fraction;
  result.configuration.assign(q.begin(), q.end());
}

}  // namespace

PathVerdict CollisionChecker::CheckPath(std::span<const Configuration> waypoints,
                                        std::span<ViewEvidence> evidence,
                                        const PathSettings& settings) const {
  if (waypoints.empty()) throw std::invalid_argument("a path has at least one waypoint");
  if (table_.drawn() != nullptr) return CheckDrawnPath(waypoints, evidence, settings);
  PathVerdict result;
  bool hidden_possible = false;
  using enum SegmentPlaces::Border;
  const SegmentPlaces::Border border = off_grid_ == OffGrid::kCell ? kGridValues : kHalfWay;
  // Whether the path ends here, because this place is not free.
  const auto stops_at = [&](const Configuration& q, size_t segment, double fraction,
                            const Between& part) {
    result.stopped = Stopped(settings.stop);
    if (result.stopped) return true;
    ++result.checked;
    const Verdict verdict = CheckPart(q, part, {});
    if (settings.tested) settings.tested({q, static_cast<int>(segment), fraction, verdict});
    hidden_possible = hidden_possible || verdict.hidden_possible();
    if (verdict.free()) return false;
    if (!evidence.empty()) CheckPart(q, part, evidence);
    // Not the second verdict: an image may be read now that was not before.
    EndAt(q, segment, fraction, verdict, result);
    return true;
  };
  for (size_t i = 0; i < waypoints.size(); ++i) {
    if (stops_at(waypoints[i], i, 0, {waypoints[i], waypoints[i]})) return result;
    if (i + 1 == waypoints.size()) break;
    const Configuration& to = waypoints[i + 1];
    if (to.size() != waypoints[i].size()) continue;  // outside the grid, as its own turn will show
    SegmentPlaces places(table_.grid(), waypoints[i], to, border);
    if (!places.resolvable()) {
      if (stops_at(to, i + 1, 0, {to, to})) return result;
      // Too many turns away.
      EndAt(to, i + 1, 0, Verdict::Unknown(Reason::kOutsideGrid), result);
      return result;
    }
    // Places between crossings and crossings, in turn: the first stand for all of the line up to
    // the next crossing.
    double begin = 0;
    bool crossing = false;
    while (const std::optional<double> place = places.Next()) {
      if (crossing) begin = *place;
      const double end = crossing ? *place : std::min(1.0, 2 * *place - begin);
      const Configuration first = Interpolated(waypoints[i], to, begin);
      const Configuration last = Interpolated(waypoints[i], to, end);
      if (stops_at(Interpolated(waypoints[i], to, *place), i, *place, {first, last})) return result;
      crossing = !crossing;
    }
  }
  result.verdict = Verdict::Free(hidden_possible);
  return result;
}

PathVerdict CollisionChecker::CheckDrawnPath(std::span<const Configuration> waypoints,
                                             std::span<ViewEvidence> evidence,
                                             const PathSettings& settings) const {
  PathVerdict result;
  bool hidden_possible = false;
  Configuration first = waypoints.front();
  Configuration last = first;
  // Whether it is free; `places`: of which nothing may be forbidden.
  const auto note = [&](const TestedPlace& place, const Between& places) {
    if (settings.tested) settings.tested(place);
    hidden_possible = hidden_possible || place.verdict.hidden_possible();
    if (place.verdict.free()) return true;
    const std::span<const double> q = place.configuration;
    if (!evidence.empty()) JudgeDrawn(q, {}, {q, q}, places, evidence);
    EndAt(q, static_cast<size_t>(place.segment), place.fraction, place.verdict, result);
    return false;
  };
  for (size_t i = 0; i < waypoints.size(); ++i) {
    const Configuration& here = waypoints[i];
    const auto segment = static_cast<int>(i);
    const Between place{here, here};
    result.stopped = Stopped(settings.stop);
    if (result.stopped) return result;
    ++result.checked;
    if (!note({here, segment, 0, JudgeDrawn(here, {}, place, place, {})}, place)) return result;
    if (i + 1 == waypoints.size()) break;
    const Configuration& next = waypoints[i + 1];
    // Beyond the limits, as its own turn will show.
    if (table_.StateBetween(next, next) == RobotImageState::kMissing) continue;
    const auto is_free = [&](const MotionPlace& at) {
      result.stopped = result.stopped || Stopped(settings.stop);
      if (result.stopped) return false;
      Interpolate(here, next, at.first, first);
      Interpolate(here, next, at.last, last);
      const bool sampled = at.growth.empty();
      const Between places{first, last};
      Verdict verdict =
          JudgeDrawn(at.q, at.growth, sampled ? Between{at.q, at.q} : places, places, {});
      if (!sampled && !verdict.free()) return false;  // that proves nothing
      // The sound presets promise that nothing is missed in between either.
      const bool unproven = sampled && at.fraction == at.last && possible_space_ != nullptr;
      if (unproven && verdict.free()) verdict = Verdict::Unknown(Reason::kMotionNotProven);
      return note({at.q, segment, at.fraction, verdict, at.growth, sampled}, places);
    };
    const MotionCheck motion =
        CheckMotion(*table_.drawn(), here, next, settings.resolution, is_free);
    result.checked += motion.checks;
    result.sampled_step = std::max(result.sampled_step, motion.sampled_step);
    if (motion.free) continue;
    result.sampled_step = 0;
    return result;
  }
  result.verdict = Verdict::Free(hidden_possible);
  return result;
}

}  // namespace silhouette
