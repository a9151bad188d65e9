// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/motion_in_map.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "db/mask/interpolation.h"
#include "db/mask/segment_places.h"

namespace silhouette::client {
namespace {

// Goes along a motion, place by place, until one is not free.
class MapWalk {
 public:
  MapWalk(const SpaceMap& map, const OffGridRule& rule, std::span<const double> from,
          std::span<const double> to)
      : map_(map), rule_(rule), from_(from), to_(to) {}

  const MotionVerdict& result() const { return result_; }

  // Whether the place at this fraction of the way is free.
  bool FreeAt(double fraction) {
    ++result_.checked;
    Interpolate(from_, to_, fraction, {result_.place.data(), from_.size()});
    const Verdict verdict = CheckInMap(
        map_.grid, rule_, q(), [this](ConfigurationNumber number) { return map_.StateAt(number); },
        [this](ConfigurationNumber number) { return map_.CellAt(number); });
    if (verdict.free()) {
      result_.last_free = fraction;
      return true;
    }
    End(fraction, verdict.state, verdict.reason);
    return false;
  }

  void EndFree() {
    result_.state = State::kFree;
    result_.proof = PathProof::kGrid;
    result_.last_free = 1;
    result_.place = {};
  }

  void End(double fraction, State state, Reason reason) {
    result_.state = state;
    result_.reason = reason;
    result_.fraction = fraction;
  }

 private:
  std::span<const double> q() const { return {result_.place.data(), from_.size()}; }

  const SpaceMap& map_;
  const OffGridRule& rule_;
  std::span<const double> from_;
  std::span<const double> to_;
  MotionVerdict result_;
};

}  // namespace

MotionVerdict UnknownMotion(Reason reason, std::span<const double> from) {
  MotionVerdict motion{.reason = reason};
  std::copy_n(from.begin(), std::min(from.size(), motion.place.size()), motion.place.begin());
  return motion;
}

MotionVerdict CheckMotionInMap(const SpaceMap& map, const OffGridRule& rule,
                               std::span<const double> from, std::span<const double> to) {
  if (rule.drawn) return UnknownMotion(Reason::kNotCheckedHere, from);
  const size_t joints = map.grid.joints().size();
  if (from.size() != joints || to.size() != joints) {
    return UnknownMotion(Reason::kOutsideGrid, from);
  }
  const auto finite = [](double value) { return std::isfinite(value); };
  if (!std::ranges::all_of(from, finite) || !std::ranges::all_of(to, finite)) {
    return UnknownMotion(Reason::kOutsideGrid, from);
  }
  MapWalk walk(map, rule, from, to);
  if (!walk.FreeAt(0)) return walk.result();
  using enum SegmentPlaces::Border;
  SegmentPlaces places(map.grid, from, to,
                       rule.off_grid == OffGrid::kNearest ? kHalfWay : kGridValues);
  while (const std::optional<double> place = places.Next()) {
    if (!walk.FreeAt(*place)) return walk.result();
  }
  if (!walk.FreeAt(1)) return walk.result();
  if (places.resolvable()) {
    walk.EndFree();
  } else {  // too many turns away
    walk.End(1, State::kUnknown, Reason::kOutsideGrid);
  }
  return walk.result();
}

}  // namespace silhouette::client
