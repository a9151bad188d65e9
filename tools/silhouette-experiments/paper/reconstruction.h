// SPDX-License-Identifier: Apache-2.0
// §2's claim put to the test: is anything won by reconstructing space from the images before
// testing? Voxel hulls against the image-based tests, from the same images: quality and time.
#pragma once

#include <vector>

#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette::paper {

// Figure 7's scene and the first settings.reconstruction.scenes random scenes, with pixels that are
// touched, for the selected variants, rigs and presets. All but the times does not depend on the
// number of threads. Fewer rows if stopped. Their experiments are "reconstruction_figure7" and
// "reconstruction"; their methods are the hulls, and the presets with min_views n.
std::vector<Row> CompareWithReconstruction(const Settings& settings, const Selection& selection,
                                           int threads, const OnProgress& on_progress);

}  // namespace silhouette::paper
