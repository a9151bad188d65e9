// The pictures of the study.
#pragma once

#include <span>

#include "common/picture/picture.h"
#include "tools/silhouette-experiments/paper/reconstruction.h"
#include "tools/silhouette-experiments/paper/settings.h"
#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette::paper {

// Figure 7 for one experiment, variant and rig: additional and missing configurations against the
// number of cameras, a row of panels per raster, a line per preset with its own threshold. Nothing
// (an empty picture) if there are no such rows.
Picture ErrorsChart(std::span<const Row> rows, Experiment experiment, Variant variant,
                    const std::string& rig);

// The same for the study of reconstruction (§2), random scenes: the hulls with the finest voxels
// beside the presets paper and calibrated.
Picture ReconstructionChart(std::span<const MethodRow> rows, Variant variant,
                            const std::string& rig);

// The configuration space of a random scene as each test reports it, with all cameras and pixels
// that are touched: what is additional, what is missing. The first scene in which the robot hides
// so much that the preset paper misses a lot, if there is one.
Picture VerdictsPicture(const Settings& settings, Variant variant, const std::string& rig);

// Figure 6: robot, obstacles of Figure 7's scene and what each camera sees of them, on a plane
// behind the scene.
Picture SetupPicture(const Settings& settings, Variant variant, const std::string& rig);

// The scene image and the obstacle image of each camera in that scene.
Picture ViewsPicture(const Settings& settings, Variant variant, const std::string& rig);

// Figure 1: real, enlarged and phantom obstacles, as two and three cameras see them.
Picture PhantomsPicture(const FloorPlan& plan);

}  // namespace silhouette::paper
