// SPDX-License-Identifier: Apache-2.0
// The measurements of §4.1: how many configurations the collision tests report wrongly, against the
// ideal test of spheres against spheres.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "server/collision/policy.h"
#include "tools/silhouette-experiments/paper/parallel_camera.h"
#include "tools/silhouette-experiments/paper/settings.h"

namespace silhouette::paper {

enum class Experiment {
  kFigure7,          // the scene of Figure 7, the robot parked where it occludes nothing
  kFigure7Occluded,  // the same, averaged over all free configurations of the robot
  kRandom,           // random scenes with the robot at a random free configuration
  kCurrentOffGrid,   // the same scenes with the robot between grid points
  kTestOffGrid,      // the same scenes, tested at configurations between grid points
};
inline constexpr int kExperiments = 5;

// "figure7", "figure7_occluded", "random", "current_off_grid", "test_off_grid".
std::string NameOf(Experiment experiment);
const std::vector<Experiment>& AllExperiments();

// What to measure; rigs by their names in the settings.
struct Selection {
  std::vector<Experiment> experiments;
  std::vector<Variant> variants;
  std::vector<std::string> rigs;
  std::vector<Raster> rasters;
  std::vector<Preset> presets;
};

// The number of views that must show an obstacle, of n.
enum class Threshold { kAll, kAllButOne };  // n; n - 1, at least 1
std::string NameOf(Threshold threshold);    // "n", "n-1"
int MinViewsOf(Threshold threshold, int views);
// The threshold that a preset has where nothing else is asked for.
Threshold OwnThreshold(Preset preset);

// Numbers of configurations: their sum, the least and the greatest.
struct Extent {
  int64_t sum = 0;
  int64_t least = std::numeric_limits<int64_t>::max();
  int64_t greatest = std::numeric_limits<int64_t>::min();

  void Add(int64_t value) {
    sum += value;
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
  void Merge(const Extent& other) {
    sum += other.sum;
    least = std::min(least, other.least);
    greatest = std::max(greatest, other.greatest);
  }
};

// Of configurations: mean, least and greatest number over scenes and sets of cameras.
struct Spread {
  double mean = 0;
  int64_t least = 0;
  int64_t greatest = 0;
};

inline Spread SpreadOf(const Extent& extent, int64_t samples) {
  return {static_cast<double>(extent.sum) / static_cast<double>(samples), extent.least,
          extent.greatest};
}

struct Tally {
  int64_t samples = 0;  // scenes times sets of cameras
  Extent occupied;      // really
  Extent additional;
  Extent missing;

  void Merge(const Tally& other) {
    samples += other.samples;
    occupied.Merge(other.occupied);
    additional.Merge(other.additional);
    missing.Merge(other.missing);
  }
};

// What one method was measured with and found, with sets of so many cameras.
struct Counts {
  Variant variant{};
  std::string rig;
  int views = 0;               // size of the sets of cameras
  int camera_sets = 0;         // of that size
  int64_t scenes = 0;          // looked at
  int64_t configurations = 0;  // tested in each
  double occupied = 0;         // mean number of configurations that the ideal test calls occupied
  Spread additional;
  Spread missing;

  // Takes over what was counted with sets of `count` of `of` views.
  void Take(const Tally& tally, int count, int of);
};

// One line of the table.
struct Row : Counts {
  Experiment experiment{};
  Raster raster{};
  Preset preset{};
  Threshold threshold{};
};

// Called with the parts done and their total. Returning false stops.
using OnProgress = std::function<bool(uint64_t done, uint64_t total)>;

// Calls work(worker, i) once for every i below `count`, and on_progress(done) from one thread at a
// time, now and then and at the end; when that returns false, no further part begins. Whether all
// is done and no stop was asked for.
bool AllDone(size_t count, int threads, const std::function<void(int worker, size_t i)>& work,
             const std::function<bool(uint64_t done)>& on_progress);

// Measures with `threads` threads. The result does not depend on how many. Fewer rows, or none, if
// stopped. Throws std::invalid_argument if the robot, parked, occludes an obstacle of Figure 7's
// scene or touches it.
std::vector<Row> Measure(const Settings& settings, const Selection& selection, int threads,
                         const OnProgress& on_progress);

}  // namespace silhouette::paper
