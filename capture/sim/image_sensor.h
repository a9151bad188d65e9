// The sensor behind the simulated lens: noise, slow drift of the brightness, grey levels.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "capture/sim/simulation.h"

namespace silhouette {

// Can be used by any number of threads.
class ImageSensor {
 public:
  explicit ImageSensor(const SimulationSettings& settings);

  // The factor of all grey levels at a simulated time, in seconds.
  double Gain(double time) const;

  // Turns a rendered row into `pixels`, of the same length. The noise depends on nothing but the
  // seed, `frame`, `camera` and `y`.
  void Expose(std::span<const float> row, double gain, uint64_t frame, size_t camera, int y,
              std::span<uint8_t> pixels) const;

 private:
  const double drift_amplitude_;
  const double drift_period_;
  const uint64_t seed_;
  // Normally distributed numbers; every row takes a run of them from a place of its own.
  std::vector<float> noise_;
};

}  // namespace silhouette
