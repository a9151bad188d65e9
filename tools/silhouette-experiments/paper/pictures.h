// SPDX-License-Identifier: Apache-2.0
// The pictures of the study. tools/plot draws its charts from the rows.
#pragma once

#include "common/picture/picture.h"
#include "tools/silhouette-experiments/paper/settings.h"

namespace silhouette::paper {

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
