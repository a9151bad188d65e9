// How verdicts are made from obstacle images (paper §3.3, §3.4).
#pragma once

#include <optional>
#include <string>

namespace silhouette {

enum class Preset {
  // Unknown and error pixels become background; an obstacle may be hidden in max_occluded_views.
  kUncalibrated,
  // The paper's literal threshold: all views must show the obstacle. Reproduces Figure 7.
  kPaper,
};

// What stands for a test configuration off the grid.
enum class OffGrid {
  kCell,     // the union of the robot images at the corners of its grid cell
  kNearest,  // the robot image of the nearest grid point
};

struct Policy {
  Preset preset = Preset::kUncalibrated;
  // Occupied if at least this many views show an obstacle; set, it overrides the preset.
  std::optional<int> min_views = std::nullopt;
  // kUncalibrated: min_views is max(1, views - max_occluded_views).
  int max_occluded_views = 1;
  OffGrid off_grid = OffGrid::kCell;

  bool operator==(const Policy&) const = default;
};

// The number of views that must show an obstacle, 1 to `views`, the number of views that the
// database was built with. Throws std::invalid_argument if the policy cannot be: min_views outside
// 1..views, max_occluded_views negative.
int MinViews(const Policy& policy, int views);

// "uncalibrated", "paper"; nothing for any other name.
std::optional<Preset> PresetFromName(const std::string& name);
std::string NameOf(Preset preset);

}  // namespace silhouette
