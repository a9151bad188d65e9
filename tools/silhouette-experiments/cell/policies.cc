#include "tools/silhouette-experiments/cell/policies.h"

#include <algorithm>

namespace silhouette::cell_experiment {

absl::StatusOr<std::vector<Policy>> PoliciesFor(const std::vector<std::string>& presets,
                                                const ServedDatabase& database) {
  const int views = database.views();
  std::vector<Policy> policies;
  for (const Preset preset : AllPresets()) {
    const bool named = std::ranges::count(presets, NameOf(preset)) > 0;
    if (!presets.empty() && !named) continue;
    if (absl::Status status = database.CanServe({.preset = preset}); !status.ok()) {
      if (named) return status;
      continue;
    }
    for (const int min_views : {views - 1, views}) {
      if (min_views == 0) continue;
      // Without a calibration the two presets differ in nothing else.
      if (preset == Preset::kUncalibrated && min_views == views && views > 1) continue;
      if (preset == Preset::kPaper && min_views < views) continue;
      if (IsSound(preset) && min_views < views) continue;
      policies.push_back({.preset = preset, .min_views = min_views});
    }
  }
  return policies;
}

}  // namespace silhouette::cell_experiment
