// §2's claim put to the test: is anything won by reconstructing space from the images before
// testing? Voxel hulls against the image-based tests, from the same images: quality and time.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette::paper {

// Processor time of one thread, with all cameras of the rig; medians over the scenes.
struct MethodTimes {
  double prepare_seconds = 0;  // what is done once per scene: obstacle images, carving
  double space_seconds = 0;    // all configurations, in the order that suits the method
  double check_seconds = 0;    // one configuration, asked alone: the mean over all
};

// One method with sets of so many cameras.
struct MethodRow {
  std::string experiment;  // "reconstruction": random scenes; "reconstruction_figure7"
  Variant variant{};
  std::string rig;
  std::string method;  // a preset's name, with min_views n; or that of a RobotOut (voxel_hull.h)
  int voxels = 0;      // along an edge of the cube; 0: image-based
  int views = 0;
  int camera_sets = 0;
  int64_t scenes = 0;
  int64_t configurations = 0;
  double occupied = 0;  // really, mean number of configurations
  Spread additional;
  Spread missing;
  std::optional<MethodTimes> times;  // only with all cameras
  // With all cameras: verdicts of the collision test that differ from those of the test on all
  // configurations at once (bulk_test.h), of scenes * configurations. Must be 0.
  int64_t disagreements = 0;
};

// Figure 7's scene and the first settings.reconstruction.scenes random scenes, with pixels that are
// touched, for the selected variants, rigs and presets. All but the times does not depend on the
// number of threads. Fewer rows if stopped.
std::vector<MethodRow> CompareWithReconstruction(const Settings& settings,
                                                 const Selection& selection, int threads,
                                                 const OnProgress& on_progress);

// One table per experiment, variant and rig, and the conclusion.
std::string TableOf(std::span<const MethodRow> rows);

// What the numbers say of §2's claim, as sentences; empty if there are not both kinds of methods
// with all cameras on random scenes.
std::string ConclusionOf(std::span<const MethodRow> rows);

// An array with the keys of the other experiments' rows (report.h), where `preset` is the method,
// and `voxels`, `prepare_ms`, `space_ms`, `check_us` where they are known.
nlohmann::ordered_json JsonOf(std::span<const MethodRow> rows);

}  // namespace silhouette::paper
