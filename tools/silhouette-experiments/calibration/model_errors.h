// SPDX-License-Identifier: Apache-2.0
// Model errors: how a real session differs from what calibration takes for true, and the sessions
// that have such errors. Metres, seconds, pixels; the world is the robot's base.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "calib/boards/board.h"
#include "calib/poses/pose_problem.h"
#include "capture/sim/tag_projection.h"
#include "tools/silhouette-experiments/calibration/rig.h"

namespace silhouette::calibration_experiment {

struct ModelErrors {
  double scale = 0;  // by how much the board is too long along its longer side, and so its other
  double shear = 0;  // by how much the lower side is shifted along x
  double bend = 0;   // how far the middle stands out of the plane through the corners
  double lens = 0;   // amplitude of waves in the image that no lens model has, pixels
  double lag = 0;    // by how much every second camera is late, while the board moves
  double blur = 0;   // standard deviation of an image's common error and of a tag's, pixels
};

// A kind of session that the experiment measures.
struct ErrorLine {
  const char* name;
  const char* meaning;
  ModelErrors errors = {};
  size_t boards = 60;       // frames of the session of lenses
  size_t robot_poses = 30;  // frames of the session of poses
  size_t wrong_poses = 0;   // how many of them the robot reports wrongly
  double most_refused = 0;  // share of the runs
};

const std::vector<ErrorLine>& ErrorLines();

// Where the camera sees the point in truth.
std::optional<Eigen::Vector2d> SeenAt(const CameraModel& camera, const ModelErrors& errors,
                                      const Eigen::Vector3d& point_in_world);

// Shifts the corners of all sightings as the errors do. What they state of their sigma stays.
void Disturb(std::span<const NamedCamera> cameras, const Board& board, const ModelErrors& errors,
             uint64_t seed, BoardFrames& frames);

// A board on the flange in the poses of the line, seen by the rig's cameras with their true lenses.
PoseProblem DrawFlangeSession(const Rig& rig, const Board& board, const ErrorLine& line,
                              uint64_t seed);

}  // namespace silhouette::calibration_experiment
