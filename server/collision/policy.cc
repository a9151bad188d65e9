// SPDX-License-Identifier: Apache-2.0
#include "server/collision/policy.h"

#include <algorithm>
#include <stdexcept>

namespace silhouette {

int DefaultOccludedViews(int views) {
  constexpr int kEnough = 3;  // views that see it
  return std::max(1, views - kEnough);
}

int MinViews(const Policy& policy, int views) {
  if (views < 1) throw std::invalid_argument("there must be at least one view");
  if (policy.min_views) {
    if (*policy.min_views < 1 || *policy.min_views > views) {
      throw std::invalid_argument("min_views must be 1 to " + std::to_string(views) +
                                  ", the number of views, not " +
                                  std::to_string(*policy.min_views));
    }
    return *policy.min_views;
  }
  const int max_occluded_views = policy.max_occluded_views.value_or(DefaultOccludedViews(views));
  if (max_occluded_views < 0) {
    throw std::invalid_argument("max_occluded_views must not be negative");
  }
  if (policy.preset != Preset::kUncalibrated) return views;
  return std::max(1, views - std::min(max_occluded_views, views));
}

int MaxOccludedViews(const Policy& policy, int views) {
  MinViews(policy, views);
  const int by_min_views = policy.min_views ? views - *policy.min_views : 0;
  const int occluded = policy.max_occluded_views.value_or(DefaultOccludedViews(views));
  return std::min(std::max(occluded, by_min_views), views - 1);
}

bool IsCalibrated(Preset preset) {
  return preset == Preset::kCalibrated || preset == Preset::kPaperCalibrated;
}

bool IsSound(Preset preset) { return preset == Preset::kSound || preset == Preset::kSoundPlanes; }

std::optional<Preset> PresetFromName(const std::string& name) {
  const auto found =
      std::ranges::find(AllPresets(), name, [](Preset preset) { return NameOf(preset); });
  return found != AllPresets().end() ? std::optional(*found) : std::nullopt;
}

std::string NameOf(Preset preset) {
  constexpr const char* kNames[] = {"uncalibrated",     "paper",        "calibrated",
                                    "paper-calibrated", "sound-planes", "sound"};
  return kNames[static_cast<size_t>(preset)];
}

const std::vector<Preset>& AllPresets() {
  static const std::vector<Preset> presets = {Preset::kUncalibrated, Preset::kPaper,
                                              Preset::kCalibrated,   Preset::kPaperCalibrated,
                                              Preset::kSoundPlanes,  Preset::kSound};
  return presets;
}

}  // namespace silhouette
