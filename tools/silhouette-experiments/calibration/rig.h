// SPDX-License-Identifier: Apache-2.0
// The cell of `silhouette-experiments calibration`: four cameras around a workspace, a little
// different with every seed, and what they see of boards.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "calib/boards/board.h"
#include "capture/sim/tag_projection.h"

namespace silhouette::calibration_experiment {

struct Rig {
  std::vector<NamedCamera> cameras;  // 1280 x 960, k1 about -0.2; the world is the robot's base
  Eigen::AlignedBox3d workspace;
};

Rig DrawRig(uint64_t seed);

// Points spread over the workspace.
std::vector<Eigen::Vector3d> PointsOfWorkspace(const Rig& rig);

// The board that is held before the cameras.
Board HandBoard();

// In and around the workspace, where two cameras see it.
BoardPlaces PlacesOf(const Rig& rig);

// The hand board in that many places: every third one there, the others close to one of the
// cameras, so that it is seen all over the image. `sigma`: noise of the corners, pixels.
BoardFrames DrawSession(const Rig& rig, size_t boards, double sigma, uint64_t seed);

}  // namespace silhouette::calibration_experiment
