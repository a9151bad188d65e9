// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/cause.h"

#include <algorithm>
#include <array>
#include <optional>

namespace silhouette::cell_experiment {
namespace {

// What went wrong at a place in a view; nothing if all is as in perfect images.
std::optional<Cause> FaultIn(const PlaceInView& view, bool on_grid) {
  if (!view.in_test_image) return on_grid ? Cause::kRobotImage : Cause::kTestCell;
  if (view.plane == PlaceInView::kBackground) return Cause::kContrast;
  if (view.robot_in_line || view.plane == PlaceInView::kObstacle) return std::nullopt;
  return view.cover;
}

int ViewsOpen(const Place& place) {
  return static_cast<int>(std::count_if(
      place.begin(), place.end(), [](const PlaceInView& view) { return !view.robot_in_line; }));
}

// The sound presets ask whether an obstacle could be there: all views together, seen or not. A
// place that no view takes for empty, or misses in the robot image, was opened away.
CauseFound FindSoundCause(std::span<const Place> places, bool on_grid) {
  std::optional<CauseFound> fault;
  for (size_t i = 0; i < places.size(); ++i) {
    std::optional<CauseFound> wrong;
    for (size_t view = 0; view < places[i].size() && !wrong; ++view) {
      const PlaceInView& at = places[i][view];
      if (at.in_test_image && at.plane != PlaceInView::kBackground) continue;
      wrong = CauseFound{.cause = *FaultIn(at, on_grid), .place = i, .view = view};
    }
    if (!wrong) return {.cause = Cause::kSize, .place = i, .view = 0};
    if (!fault) fault = wrong;
  }
  return *fault;
}

}  // namespace

std::string NameOf(Cause cause) {
  static const std::array<const char*, kCauses> names = {
      "hidden", "occluded",    "contrast",  "rim",  "robot_cell",
      "shadow", "robot_image", "test_cell", "size", "unexplained"};
  return names[static_cast<size_t>(cause)];
}

CauseFound FindCause(std::span<const Place> places, const Policy& policy, bool on_grid) {
  if (IsSound(policy.preset)) return FindSoundCause(places, on_grid);
  const int views = static_cast<int>(places[0].size());
  const int needed = IsCalibrated(policy.preset) ? 1 : MinViews(policy, views);
  std::optional<CauseFound> fault;
  size_t fewest = places[0].size() + 1;  // faulty views of a place that should convict
  CauseFound hidden{.cause = Cause::kHidden, .place = 0, .view = 0};
  for (size_t i = 0; i < places.size(); ++i) {
    if (ViewsOpen(places[i]) > ViewsOpen(places[hidden.place])) hidden.place = i;
    if (ViewsOpen(places[i]) < needed) continue;
    size_t faults = 0;
    CauseFound found{.cause = Cause::kUnexplained, .place = i, .view = 0};
    for (size_t view = 0; view < places[i].size(); ++view) {
      const std::optional<Cause> wrong = FaultIn(places[i][view], on_grid);
      if (!wrong) continue;
      if (faults++ == 0) {
        found.cause = *wrong;
        found.view = view;
      }
    }
    if (faults >= fewest) continue;
    fewest = faults;
    fault = found;
  }
  if (ViewsOpen(places[hidden.place]) > 0) hidden.cause = Cause::kOccluded;
  return fault.value_or(hidden);
}

}  // namespace silhouette::cell_experiment
