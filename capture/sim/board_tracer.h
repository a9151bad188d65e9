// SPDX-License-Identifier: Apache-2.0
// BoardTracer: the pixels that show boards, averaged over the pixel's area in the distorted image.
//
// A pixel that shows nothing but one board gets the exact share of black in it. Where something
// else is seen as well - the board's edge, or what hides it - 64 rays decide.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "capture/sim/background.h"
#include "capture/sim/body_part.h"
#include "capture/sim/ray_scene.h"
#include "capture/sim/simulated_board.h"
#include "capture/sim/simulation.h"

namespace silhouette {

// Where a camera's pixels have their corners, without distortion: x and y at z = 1 of the camera's
// frame. Can be used by any number of threads.
class CornerRays {
 public:
  explicit CornerRays(const CameraModel& camera);

  // The corners (x - 0.5, y - 0.5) for x = 0 to the image's width.
  std::span<const Eigen::Vector2d> Row(int y) const;

 private:
  const CameraModel camera_;
  // Made when first asked for.
  mutable std::vector<std::vector<Eigen::Vector2d>> rows_;
  std::unique_ptr<std::once_flag[]> made_;
};

class BoardTracer {
 public:
  explicit BoardTracer(const SimulationSettings& settings);

  // The boards as bodies; their frames are the indices of settings.boards.
  std::vector<BodyPart> Plates() const;

  // Which pixels of which row, and what is needed to see what is in them.
  struct Pixels {
    const RayScene* scene = nullptr;
    size_t first_part = 0;  // number of the first board's plate in the scene; the others follow
    const Background* background = nullptr;
    size_t camera = 0;
    int y = 0;
    int left = 0;
    int right = 0;  // not included
  };

  // Replaces those of the pixels in `row` that show a board. Can be used by any number of threads
  // while nothing is placed in the scene.
  void Trace(const Pixels& pixels, std::span<float> row) const;

 private:
  class Work;

  const SimulationSettings settings_;
  std::vector<BoardTexture> textures_;
  std::vector<CornerRays> corners_;  // by camera
};

}  // namespace silhouette
