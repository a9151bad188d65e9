// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/off_grid.h"

#include <algorithm>

namespace silhouette::client {
namespace {

// The number of views that must show an obstacle; nothing if unknown.
std::optional<int> MinViews(const Policy& policy, int views) {
  if (policy.min_views) return policy.min_views;
  if (views < 1) return std::nullopt;
  if (policy.preset != "uncalibrated") return views;
  // Unspecified: the server uses a value of its own, whatever its default preset is.
  if (!policy.max_occluded_views) return std::nullopt;
  return std::max(1, views - std::min(*policy.max_occluded_views, views));
}

// Whether robot images alone decide. Then a view that shows an obstacle at a corner shows one at
// all of them together; and one that shows none at any corner shows none at all of them together,
// as long as no other view shows one.
bool ByImagesAlone(const Policy& policy) {
  return policy.preset == "uncalibrated" || policy.preset == "paper" ||
         policy.preset == "calibrated" || policy.preset == "paper-calibrated";
}

}  // namespace

Policy Effective(const Policy& asked, const Policy& defaults) {
  Policy policy = defaults;
  if (!asked.preset.empty()) {
    policy = {.preset = asked.preset,
              .max_occluded_views = defaults.max_occluded_views,
              .off_grid = defaults.off_grid};
  }
  if (asked.max_occluded_views) {
    policy.max_occluded_views = asked.max_occluded_views;
    policy.min_views.reset();
  }
  if (asked.min_views) policy.min_views = asked.min_views;
  if (asked.off_grid) policy.off_grid = asked.off_grid;
  return policy;
}

OffGridRule OffGridRuleOf(const Policy& policy, int views) {
  return {.off_grid = policy.off_grid.value_or(OffGrid::kCell),
          .free_corners_suffice = MinViews(policy, views) == 1 && ByImagesAlone(policy),
          .occupied_corner_suffices = ByImagesAlone(policy)};
}

}  // namespace silhouette::client
