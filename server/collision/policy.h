// SPDX-License-Identifier: Apache-2.0
// How verdicts are made from obstacle images (paper §3.3, §3.4).
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace silhouette {

// What unknown and error pixels are taken for, and how many views must show an obstacle.
enum class Preset {
  // Unknown and error pixels become background; an obstacle may be hidden in max_occluded_views.
  kUncalibrated,
  // As before, with the paper's literal threshold: all views must show the obstacle. Reproduces
  // Figure 7.
  kPaper,
  // Unknown and error pixels are resolved along the epipolar lines in the intersection images; all
  // views must show the obstacle.
  kCalibrated,
  // The same by the letter of the paper: lines in the obstacle images, and by Table 3 an error
  // pixel convicts as an obstacle pixel does. (The prose of §3.3 makes such a pixel background.)
  kPaperCalibrated,
  // Whether an obstacle of a least size could be anywhere the robot would be, seen or not
  // (possible_space.h): what is possible is projected into the views ...
  kSoundPlanes,
  // ... and one and the same possible place must meet the robot image in every view.
  kSound,
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
  // In how many views the robot may occlude an obstacle; DefaultOccludedViews where it is not set.
  // kUncalibrated: min_views is max(1, views - max_occluded_views). Sound presets:
  // MaxOccludedViews().
  std::optional<int> max_occluded_views = std::nullopt;
  OffGrid off_grid = OffGrid::kCell;

  bool operator==(const Policy&) const = default;
};

// 1; of more than four views all but three, as the robot occludes an obstacle in more of them.
int DefaultOccludedViews(int views);

// The number of views that must show an obstacle, 1 to `views`, the number of views that the
// database was built with. Throws std::invalid_argument if the policy cannot be: min_views outside
// 1..views, max_occluded_views negative.
int MinViews(const Policy& policy, int views);

// Sound presets and separation: what all but this many of the views see as an obstacle stays,
// however small it is (possible_voxels.h). At least what the other presets permit with the same
// numbers. Throws as MinViews does.
int MaxOccludedViews(const Policy& policy, int views);

// Whether a preset needs epipolar lines; whether it needs the space of possible obstacles.
bool IsCalibrated(Preset preset);
bool IsSound(Preset preset);

// "uncalibrated", "paper", "calibrated", "paper-calibrated", "sound-planes", "sound"; nothing for
// any other name.
std::optional<Preset> PresetFromName(const std::string& name);
std::string NameOf(Preset preset);
const std::vector<Preset>& AllPresets();

}  // namespace silhouette
