// SPDX-License-Identifier: Apache-2.0
// Sightings of tags without images: exactly projected corners with noise, as calibration would get
// them from a detector of that accuracy. For experiments and tests that need many.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/camera/camera_model.h"
#include "capture/sim/chance.h"

namespace silhouette {

struct NamedCamera {
  std::string view;
  CameraModel model;
};

struct TagProjectionSettings {
  double sigma = 0.1;      // noise of a corner per axis, pixels; 0 is stated as 1e-3
  double least_size = 20;  // of a tag's shortest side, pixels
  double most_tilt = 1.2;  // radians between a tag's normal and the ray to it
  double border = 2;       // pixels that a corner keeps from the image's border
};

// The tags of a board that a camera sees: wholly in the image, their front to the camera, not
// smaller and not more tilted than the settings say. `world_from_board`: the board's pose in the
// frame of camera_from_world.
std::vector<TagSighting> ProjectTags(const NamedCamera& camera, const std::string& frame,
                                     const Board& board, const Eigen::Isometry3d& world_from_board,
                                     const TagProjectionSettings& settings, Chance& chance);

struct BoardPlaces {
  Eigen::AlignedBox3d volume;  // of the boards' middles, in the world
  double tilt = 0.8;           // most, radians, off the direction to the cameras that are to see it
  size_t least_views = 1;      // views in which at least half of the board's tags are seen
};

// What one or several cameras see of a board that is held somewhere else in every frame.
struct BoardFrames {
  std::vector<std::string> frames;                  // their names: "0001", ...
  std::vector<Eigen::Isometry3d> world_from_board;  // by frame
  std::vector<TagSighting> sightings;               // of all frames and views
};

// Draws `frames` poses of the board: its middle anywhere in the volume, its front towards a random
// mixture of the cameras, tilted and turned by chance; poses that too few views see are drawn
// again. Throws std::invalid_argument if no pose is found that the cameras see.
BoardFrames DrawBoardFrames(std::span<const NamedCamera> cameras, const Board& board,
                            const BoardPlaces& places, size_t frames,
                            const TagProjectionSettings& settings, uint64_t seed);

// A pose of the board with its middle at `middle`, its front in the direction `normal`, turned
// about it by `turn` radians.
Eigen::Isometry3d HeldAt(const Board& board, const Eigen::Vector3d& middle,
                         const Eigen::Vector3d& normal, double turn);

// The middle of a board in its own frame.
Eigen::Vector3d MiddleOf(const Board& board);

}  // namespace silhouette
