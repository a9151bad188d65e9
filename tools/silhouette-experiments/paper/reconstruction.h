// SPDX-License-Identifier: Apache-2.0
// §2's claim put to the test: is anything won by reconstructing space from the images before
// testing? Voxel hulls against the image-based tests, from the same images: quality and time.
#pragma once

#include <cstdint>
#include <optional>
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
struct MethodRow : Counts {
  std::string experiment;  // "reconstruction": random scenes; "reconstruction_figure7"
  std::string method;  // a preset's name, with min_views n; or that of a RobotOut (voxel_hull.h)
  int voxels = 0;      // along an edge of the cube; 0: image-based
  std::optional<MethodTimes> times;  // only with all cameras
  // With all cameras: verdicts of the product that differ from those of the check of all
  // configurations at once (bulk_checker.h), of scenes * configurations. Must be 0.
  int64_t disagreements = 0;
};

// Figure 7's scene and the first settings.reconstruction.scenes random scenes, with pixels that are
// touched, for the selected variants, rigs and presets. All but the times does not depend on the
// number of threads. Fewer rows if stopped.
std::vector<MethodRow> CompareWithReconstruction(const Settings& settings,
                                                 const Selection& selection, int threads,
                                                 const OnProgress& on_progress);

}  // namespace silhouette::paper
