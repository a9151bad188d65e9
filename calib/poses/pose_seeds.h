// First values for all poses of a network.
#pragma once

#include <string>
#include <vector>

#include "calib/poses/pose_network.h"

namespace silhouette {

// Fills Look::candidates; a look that no pose explains (fewer than four usable corners, corners
// beyond the lens's fold) stays without.
void FindCandidates(PoseNetwork& network);

// Fills camera_poses and board_poses as far as they are connected: from known boards to views and
// back, and by hand-eye calibration where neither is known. Returns why views that did not get a
// pose have none, one sentence each; empty if all have one.
std::vector<std::string> SeedPoses(PoseNetwork& network);

}  // namespace silhouette
