// SPDX-License-Identifier: Apache-2.0
// The sensor behind the simulated lens: exposure, light that drifts and flickers, noise, pixels
// that jump, grey levels.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "capture/sim/simulation.h"

namespace silhouette {

// Can be used by any number of threads.
class ImageSensor {
 public:
  explicit ImageSensor(const SimulationSettings& settings);

  // The factor of all grey levels: `middle` in the middle of the image, growing by `slope` towards
  // the right edge and falling as much towards the left one.
  struct Gain {
    double middle = 1;
    double slope = 0;
  };
  // Of a camera's image at a simulated time, in seconds.
  Gain GainAt(double time, uint64_t frame, size_t camera) const;

  // Which row of which image it is.
  struct Place {
    uint64_t frame = 0;
    size_t camera = 0;
    int y = 0;
  };
  // Turns a rendered row into `pixels`, of the same length: `channels` values per pixel. Noise and
  // jumps depend on nothing but the seed and the place.
  void Expose(std::span<const float> row, const Gain& gain, const Place& place,
              std::span<uint8_t> pixels, size_t channels = 1) const;

 private:
  void AddJumps(const Place& place, size_t channels, std::span<uint8_t> pixels) const;

  const SimulationSettings settings_;
  // Normally distributed numbers; every row takes a run of them from a place of its own.
  std::vector<float> noise_;
};

// The blur of a lens.

// Convolves `image`, of floating-point channels, with a Gaussian of standard deviation `sigma`
// pixels that is integrated over each pixel. Beyond the border lies what is at the border. 0:
// leaves it as it is.
void Blur(cv::Mat& image, double sigma);

}  // namespace silhouette
