// SPDX-License-Identifier: Apache-2.0
// Photographer: images of a board by a camera of the simulated cell, without a robot.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "capture/sim/image_sensor.h"
#include "capture/sim/renderer.h"
#include "capture/sim/simulation.h"
#include "capture/sim/tag_projection.h"

namespace silhouette::calibration_experiment {

// How an image is taken.
struct Shot {
  ImageSensor::Gain gain = {};
  double blur = 0.6;      // standard deviation of the lens' blur, pixels
  double vignetting = 0;  // share of the light that the image's corners lack
  // The board's motion from begin to end of the exposure, in the board's frame.
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
};

class Photographer {
 public:
  Photographer(const NamedCamera& camera, const Board& board, uint64_t seed);

  // CV_8UC1. `world_from_board`: in the middle of the exposure.
  cv::Mat Take(const Eigen::Isometry3d& world_from_board, const Shot& shot = {});

 private:
  // CV_32FC1, without blur.
  cv::Mat Render(const Eigen::Isometry3d& world_from_board);

  const SimulationSettings settings_;
  Renderer renderer_;
  ImageSensor sensor_;
  uint64_t frame_ = 0;
};

}  // namespace silhouette::calibration_experiment
