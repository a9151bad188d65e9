// The measurements of §4.1: how many configurations the collision tests report wrongly, against the
// ideal test of spheres against spheres.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/collision/policy.h"
#include "tools/silhouette-experiments/paper/parallel_camera.h"
#include "tools/silhouette-experiments/paper/settings.h"
#include "tools/silhouette-experiments/paper/tally.h"

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

// One line of the table.
struct Row {
  Experiment experiment;
  Variant variant;
  std::string rig;
  Raster raster;
  Preset preset;
  Threshold threshold;
  int views = 0;               // size of the sets of cameras
  int camera_sets = 0;         // of that size
  int64_t scenes = 0;          // looked at
  int64_t configurations = 0;  // tested in each
  double occupied = 0;         // mean number of configurations that the ideal test calls occupied
  Spread additional;
  Spread missing;
};

// Told of progress: parts done, of all. Returning false stops.
using OnProgress = std::function<bool(uint64_t done, uint64_t total)>;

// Measures with `threads` threads. The result does not depend on how many. Fewer rows, or none, if
// stopped. Throws std::invalid_argument if the robot, parked, occludes an obstacle of Figure 7's
// scene or touches it.
std::vector<Row> Measure(const Settings& settings, const Selection& selection, int threads,
                         const OnProgress& on_progress);

}  // namespace silhouette::paper
