// SPDX-License-Identifier: Apache-2.0
// The default settings, made small: fewer pixels, configurations and scenes.
#pragma once

#include <utility>
#include <vector>

#include "tools/silhouette-experiments/paper/study.h"

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

inline const OnProgress kGoOn = [](uint64_t, uint64_t) { return true; };

inline Selection Everything(std::vector<Experiment> experiments, std::vector<Preset> presets) {
  return {std::move(experiments),
          {Variant::kPlanar, Variant::kSpatial},
          {"A", "B"},
          {Raster::kCentre, Raster::kTouch},
          std::move(presets)};
}

}  // namespace silhouette::paper
