// Images of a board by a camera of the simulated cell, without a robot.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "capture/sim/image_sensor.h"
#include "capture/sim/renderer.h"
#include "capture/sim/tag_projection.h"

namespace silhouette::calibration_experiment {

class Photographer {
 public:
  // Of the sensor, grey levels and pixels.
  static constexpr double kNoise = 2;
  static constexpr double kBlur = 0.6;

  Photographer(const NamedCamera& camera, const Board& board, uint64_t seed);

  // Row by row from the top left, of the camera's size.
  std::vector<uint8_t> Take(const Eigen::Isometry3d& world_from_board);

 private:
  const SimulationSettings settings_;
  Renderer renderer_;
  ImageSensor sensor_;
  uint64_t frame_ = 0;
};

}  // namespace silhouette::calibration_experiment
