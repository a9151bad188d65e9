// SPDX-License-Identifier: Apache-2.0
// The default settings, made small: fewer pixels, configurations and scenes.
#pragma once

#include "tools/silhouette-experiments/paper/settings.h"

namespace silhouette::paper {

inline Settings SmallSettings(int pixels = 24, int steps = 12) {
  Settings settings = ReadSettings("");
  settings.pixels = pixels;
  settings.steps = steps;
  settings.random.count = 3;
  settings.sound.occluded_scenes = 2;
  for (auto& [name, rig] : settings.rigs) {
    std::vector<ParallelCamera> cameras;
    for (const ParallelCamera& camera : rig) {
      cameras.emplace_back(camera.direction(), settings.half_width, pixels);
    }
    rig = cameras;
  }
  return settings;
}

}  // namespace silhouette::paper
