#include "capture/sim/image_sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

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

// std::normal_distribution gives other numbers with other libraries; this does not.
std::vector<float> NormalNumbers(uint64_t seed, double sigma) {
  std::mt19937_64 random(seed);
  const auto uniform = [&] { return (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53; };
  std::vector<float> numbers(kNoiseNumbers);
  for (float& number : numbers) {
    const double radius = std::sqrt(-2 * std::log(uniform()));
    number = static_cast<float>(sigma * radius * std::cos(2 * std::numbers::pi * uniform()));
  }
  return numbers;
}

}  // namespace

ImageSensor::ImageSensor(const SimulationSettings& settings)
    : drift_amplitude_(settings.drift_amplitude),
      drift_period_(settings.drift_period),
      seed_(settings.seed),
      noise_(NormalNumbers(settings.seed, settings.noise_sigma)) {}

double ImageSensor::Gain(double time) const {
  return 1 + drift_amplitude_ * std::sin(2 * std::numbers::pi * time / drift_period_);
}

void ImageSensor::Expose(std::span<const float> row, double gain, uint64_t frame, size_t camera,
                         int y, std::span<uint8_t> pixels) const {
  const auto factor = static_cast<float>(gain);
  size_t place =
      Scatter(seed_ ^ Scatter(frame ^ Scatter(camera ^ Scatter(static_cast<uint64_t>(y)))));
  for (size_t x = 0; x < row.size(); ++x) {
    const float level = factor * row[x] + noise_[(place + x) % kNoiseNumbers];
    pixels[x] = static_cast<uint8_t>(std::clamp(level + 0.5F, 0.0F, 255.0F));
  }
}

}  // namespace silhouette
