// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/image_sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "capture/sim/chance.h"

namespace silhouette {
namespace {

constexpr size_t kNoiseNumbers = size_t{1} << 17;

// The splitmix64 step: neighbouring inputs give unrelated outputs.
uint64_t Scatter(uint64_t x) {
  x += 0x9E3779B97F4A7C15u;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

std::vector<float> NormalNumbers(uint64_t seed, double sigma) {
  Chance chance(seed);
  std::vector<float> numbers(kNoiseNumbers);
  for (float& number : numbers) number = static_cast<float>(sigma * chance.Normal());
  return numbers;
}

// From -1 to 1.
double Signed(uint64_t scattered) { return static_cast<double>(scattered >> 11) * 0x1p-52 - 1; }

uint8_t GreyLevel(float level) {
  return static_cast<uint8_t>(std::clamp(level + 0.5F, 0.0F, 255.0F));
}

}  // namespace

ImageSensor::ImageSensor(const SimulationSettings& settings)
    : settings_(settings), noise_(NormalNumbers(settings.seed, settings.noise_sigma)) {}

ImageSensor::Gain ImageSensor::GainAt(double time, uint64_t frame, size_t camera) const {
  const double drift = std::sin(2 * std::numbers::pi * time / settings_.drift_period);
  const uint64_t image = Scatter(settings_.seed ^ Scatter(frame ^ Scatter(~uint64_t{camera})));
  const double middle =
      1 + settings_.drift_amplitude * drift + settings_.flicker_amplitude * Signed(image);
  const double slope =
      settings_.drift_slope * drift + settings_.flicker_slope * Signed(Scatter(image));
  return {.middle = settings_.exposure * middle, .slope = settings_.exposure * slope};
}

void ImageSensor::Expose(std::span<const float> row, const Gain& gain, const Place& place,
                         std::span<uint8_t> pixels, size_t channels) const {
  const uint64_t camera = Scatter(place.camera ^ Scatter(static_cast<uint64_t>(place.y)));
  const size_t start = Scatter(settings_.seed ^ Scatter(place.frame ^ camera));
  const double step = 2 * gain.slope / static_cast<double>(std::max<size_t>(row.size(), 2) - 1);
  for (size_t x = 0; x < row.size(); ++x) {
    const auto factor =
        static_cast<float>(gain.middle - gain.slope + step * static_cast<double>(x));
    pixels[x] = GreyLevel(factor * row[x] + noise_[(start + x) % kNoiseNumbers]);
  }
  if (settings_.unsteady_share > 0) AddJumps(place, channels, pixels);
}

void ImageSensor::AddJumps(const Place& place, size_t channels, std::span<uint8_t> pixels) const {
  const uint64_t row = Scatter(settings_.seed ^ Scatter(place.camera)) + uint64_t(place.y) * 65536;
  for (size_t x = 0; x < pixels.size(); x += channels) {
    const uint64_t pixel = Scatter(row + x);
    if (std::abs(Signed(pixel)) >= settings_.unsteady_share) continue;
    // It is where it should be in two of three images.
    const uint64_t now = Scatter(pixel ^ Scatter(place.frame));
    if (now % 3 != 0) continue;
    const auto jump = static_cast<float>(settings_.unsteady_jump * Signed(Scatter(now)));
    for (size_t c = 0; c < channels; ++c) {
      pixels[x + c] = GreyLevel(static_cast<float>(pixels[x + c]) + jump);
    }
  }
}

void Blur(cv::Mat& image, double sigma) {
  if (!(sigma > 0) || image.empty()) return;
  // The share of each pixel from -reach to reach, integrated over its area.
  const int reach = static_cast<int>(std::ceil(4 * sigma));
  const auto below = [&](double x) { return 0.5 * std::erfc(-x / (sigma * std::sqrt(2.0))); };
  std::vector<float> kernel;
  for (int i = -reach; i <= reach; ++i) {
    kernel.push_back(static_cast<float>(below(i + 0.5) - below(i - 0.5)));
  }
  cv::normalize(kernel, kernel, 1, 0, cv::NORM_L1);
  cv::sepFilter2D(image, image, -1, kernel, kernel, {-1, -1}, 0, cv::BORDER_REPLICATE);
}

}  // namespace silhouette
