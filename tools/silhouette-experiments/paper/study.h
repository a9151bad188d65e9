// SPDX-License-Identifier: Apache-2.0
// The measurements of §4.1: how many configurations the presets report wrongly, against the ideal
// test of spheres against spheres.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/collision/policy.h"
#include "tools/silhouette-experiments/paper/bulk_checker.h"
#include "tools/silhouette-experiments/paper/geometry.h"
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
// A preset's default threshold.
Threshold OwnThreshold(Preset preset);

// Numbers of configurations over scenes and sets of cameras.
struct Spread {
  int64_t samples = 0;
  int64_t sum = 0;
  int64_t least = std::numeric_limits<int64_t>::max();
  int64_t greatest = std::numeric_limits<int64_t>::min();

  double mean() const { return static_cast<double>(sum) / static_cast<double>(samples); }
  void Add(int64_t value) { Merge({1, value, value, value}); }
  void Merge(const Spread& other) {
    samples += other.samples;
    sum += other.sum;
    least = std::min(least, other.least);
    greatest = std::max(greatest, other.greatest);
  }
};

struct Tally {
  Spread occupied;  // as the ideal test reports
  Spread additional;
  Spread missing;

  void Add(ConfigurationWords truth, ConfigurationWords reported) {
    occupied.Add(Count(truth));
    additional.Add(CountWithout(reported, truth));
    missing.Add(CountWithout(truth, reported));
  }
  void Merge(const Tally& other) {
    occupied.Merge(other.occupied);
    additional.Merge(other.additional);
    missing.Merge(other.missing);
  }
};

// Processor time of one thread, with all cameras of the rig; medians over the scenes.
struct MethodTimes {
  double prepare_seconds = 0;  // what is done once per scene: obstacle images, carving
  double space_seconds = 0;    // all configurations, in the order that suits the method
  double check_seconds = 0;    // one configuration, asked alone: the mean over all
};

// One line of the table: what one method found with sets of one number of cameras.
struct Row : Tally {
  std::string experiment;
  Variant variant{};
  std::string rig;
  Raster raster{};
  std::string method;  // a preset's name, or that of a RobotOut (voxel_hull.h)
  int voxels = 0;      // along an edge of the hull's cube; 0: image-based
  Threshold threshold{};
  int views = 0;               // size of the sets of cameras
  int camera_sets = 0;         // of that size
  int64_t scenes = 0;          // looked at
  int64_t configurations = 0;  // tested in each
  // Of the reconstruction, and only with all cameras.
  std::optional<MethodTimes> times;
  // Verdicts of the product that differ from those of BulkChecker, of scenes * configurations. Must
  // be 0.
  int64_t disagreements = 0;

  // Takes over what was counted with sets of `count` of `of` views.
  void Take(const Tally& tally, int count, int of);
};

// Called with the parts done and their total. Returning false stops.
using OnProgress = std::function<bool(uint64_t done, uint64_t total)>;

// Calls work(worker, i) once for every i below `count`, and on_progress(done) from one thread at a
// time, now and then and at the end; when that returns false, no further part begins. Whether all
// is done.
bool AllDone(size_t count, int threads, const std::function<void(int worker, size_t i)>& work,
             const std::function<bool(uint64_t done)>& on_progress);

// Calls Measure(parts[i]) of workers, one for each thread, which `make` makes. The first of them
// after it merged the others, or nothing if stopped.
template <typename Make, typename Part>
auto Measured(const Make& make, const std::vector<Part>& parts, int threads,
              const std::function<bool(uint64_t done)>& on_progress) -> decltype(make()) {
  std::vector<decltype(make())> workers;
  for (int i = 0; i < threads; ++i) workers.push_back(make());
  const auto work = [&](int worker, size_t i) {
    workers[static_cast<size_t>(worker)]->Measure(parts[i]);
  };
  if (!AllDone(parts.size(), threads, work, on_progress)) return nullptr;
  for (size_t i = 1; i < workers.size(); ++i) workers[0]->Merge(*workers[i]);
  return std::move(workers[0]);
}

// Measures with `threads` threads. The result does not depend on how many. Fewer rows, or none, if
// stopped. Throws std::invalid_argument if the robot, parked, occludes an obstacle of Figure 7's
// scene or touches it.
std::vector<Row> Measure(const Settings& settings, const Selection& selection, int threads,
                         const OnProgress& on_progress);

}  // namespace silhouette::paper
