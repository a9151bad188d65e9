// SPDX-License-Identifier: Apache-2.0
// How well the segmentation finds obstacles, and nothing else, in simulated camera images: measured
// against what every pixel really shows.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "capture/segmentation/settings.h"
#include "capture/sim/simulation.h"
#include "common/picture/picture.h"
#include "tools/silhouette-experiments/cell/simulated_workplace.h"

namespace silhouette::segmentation_experiment {

// A state of light and cameras.
struct Condition {
  std::string name;
  std::function<void(SimulationSettings&)> change;
};
std::vector<Condition> Conditions();

// A way to segment.
struct Method {
  std::string name;
  SegmentationSettings settings;
};
std::vector<Method> Methods();

// Which obstacles stand there: of any brightness and colour, or such that differ by 0.06 of the
// light at least from what the room throws back.
enum class Obstacles { kAny, kPlain };

struct Figures {
  int64_t obstacle_pixels = 0;  // of the camera images, not at an edge of what is seen
  int64_t found_pixels = 0;
  int64_t empty_pixels = 0;  // neither robot nor obstacle nor shadow, nor next to one
  int64_t false_pixels = 0;
  // Of the masks; obstacle: with robot or obstacle on all eight sides; empty: not next to any.
  int64_t obstacle_mask = 0;
  int64_t found_mask = 0;
  int64_t empty_mask = 0;
  int64_t false_mask = 0;
  int64_t shadow_mask = 0;  // shadow, not next to robot or obstacle
  int64_t shadow_foreground = 0;
  int64_t all_mask = 0;

  double recall() const { return Share(found_mask, obstacle_mask); }
  double false_share() const { return Share(false_mask, all_mask); }
  static double Share(int64_t part, int64_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
  }
};

struct StudySettings {
  int scenes = 20;
  int reference_images = 20;
  uint64_t seed = 1;
  bool colour = false;
  Obstacles obstacles = Obstacles::kAny;
};

// One row per method. `stop` is asked between scenes; then the figures are of those done.
std::vector<Figures> Measure(const cell_experiment::SimulatedWorkplace& workplace,
                             const Condition& condition, std::span<const Method> methods,
                             const StudySettings& settings, const std::function<bool()>& stop);

// The first scene in its first view: the image, and per method what is found, false and missed.
Picture PictureOfScene(const cell_experiment::SimulatedWorkplace& workplace,
                       const Condition& condition, std::span<const Method> methods,
                       const StudySettings& settings);

}  // namespace silhouette::segmentation_experiment
