// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/brightness.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace silhouette {
namespace {

constexpr int kSamples = 2000;   // pixels to find the gain from, about
constexpr size_t kFewest = 50;   // fewer are not enough
constexpr int kCandidates = 40;  // gains that are tried
constexpr double kBrightnessDarkest =
    12;  // grey levels; darker pixels hardly change with the light
constexpr double kBrightnessBrightest = 250;  // brighter ones may have been cut off
constexpr double kLeastGain = 0.5;
constexpr double kGreatestGain = 2;
constexpr double kGreatestOffset = 30;  // grey levels
// An offset must explain this many times the pixels that a gain alone does.
constexpr double kOffsetsWorth = 1.05;

// One beside the other, for the compiler to vectorise what is done with all of them.
struct Samples {
  std::vector<float> grey;
  std::vector<float> mean;
  std::vector<float> tolerance;

  size_t size() const { return grey.size(); }
  bool ExplainedBy(size_t i, float gain, float offset = 0) const {
    return std::abs(grey[i] - gain * mean[i] - offset) <= tolerance[i];
  }
};

// Channels count as pixels of their own.
Samples TakeSamples(const cv::Mat& image, const Reference& reference, const SlowLight& slow_light) {
  constexpr float kUnit = 1.0F / Reference::kGreyLevel;
  const int stride =
      std::max(1, static_cast<int>(std::sqrt(static_cast<double>(image.total()) / kSamples)));
  const int channels = image.channels();
  Samples samples;
  for (int y = stride / 2; y < image.rows; y += stride) {
    const auto* levels = image.ptr<uint8_t>(y);
    const auto* mean = reference.mean().ptr<uint16_t>(y);
    const auto* noise = reference.noise().ptr<uint16_t>(y);
    for (int x = stride / 2; x < image.cols; x += stride) {
      const int i = x * channels + x / stride % channels;
      if (noise[i] == Reference::kUndefined) continue;
      const auto slow = static_cast<float>(slow_light.At(x, y, image.size()));
      const float expected = slow * kUnit * static_cast<float>(mean[i]);
      if (!(expected >= kBrightnessDarkest && expected <= kBrightnessBrightest &&
            levels[i] <= kBrightnessBrightest))
        continue;
      samples.grey.push_back(levels[i]);
      samples.mean.push_back(expected);
      samples.tolerance.push_back(std::max(1.0F, 3 * kUnit * static_cast<float>(noise[i])));
    }
  }
  return samples;
}

// Gains that single pixels speak for, densest where many agree; 1 comes first.
std::vector<float> Candidates(const Samples& samples) {
  std::vector<float> gains;
  for (size_t i = 0; i < samples.size(); ++i) gains.push_back(samples.grey[i] / samples.mean[i]);
  std::sort(gains.begin(), gains.end());
  std::vector<float> candidates = {1};
  for (int i = 0; i < kCandidates; ++i) {
    const double place = (i + 0.5) / kCandidates * static_cast<double>(gains.size());
    candidates.push_back(gains[static_cast<size_t>(place)]);
  }
  return candidates;
}

// The gain of least squares over the samples that `gain` explains.
float Refine(const Samples& samples, float gain) {
  double product = 0;
  double square = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (!samples.ExplainedBy(i, gain)) continue;
    product += samples.grey[i] * samples.mean[i];
    square += samples.mean[i] * samples.mean[i];
  }
  return square > 0 ? static_cast<float>(product / square) : gain;
}

int Explained(const Samples& samples, const Brightness& light) {
  const auto gain = static_cast<float>(light.gain);
  const auto offset = static_cast<float>(light.offset);
  int explained = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    explained += samples.ExplainedBy(i, gain, offset) ? 1 : 0;
  }
  return explained;
}

// The line of least squares through the samples that lie near one. Begins with `light`, the refined
// gain without an offset.
Brightness WithOffset(const Samples& samples, Brightness light) {
  for (int i = 0; i < 5; ++i) {
    const float wide = i < 3 ? 3 : 1;  // so much further away than their tolerance may they lie
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (size_t s = 0; s < samples.size(); ++s) {
      const float mean = samples.mean[s];
      const float grey = samples.grey[s];
      const double expected = light.gain * mean + light.offset;
      if (std::abs(grey - expected) > wide * samples.tolerance[s]) continue;
      n += 1;
      x += mean;
      y += grey;
      xx += mean * mean;
      xy += mean * grey;
    }
    const double spread = n * xx - x * x;
    if (n < kFewest || !(spread > n * n)) return {};  // all alike: nothing to tell them apart by
    light.gain = (n * xy - x * y) / spread;
    light.offset = (y - light.gain * x) / n;
  }
  return light;
}

}  // namespace

Brightness BrightnessOf(const cv::Mat& image, const Reference& reference,
                        const SlowLight& slow_light) {
  const Samples samples = TakeSamples(image, reference, slow_light);
  if (samples.size() < kFewest) return {};
  Brightness best;
  int most = -1;
  for (float gain : Candidates(samples)) {
    const Brightness light{.gain = gain};
    const int explained = Explained(samples, light);
    if (explained > most) {
      most = explained;
      best = light;
    }
  }
  for (int i = 0; i < 2; ++i) best.gain = Refine(samples, static_cast<float>(best.gain));
  const Brightness shifted = WithOffset(samples, best);
  if (std::abs(shifted.offset) <= kGreatestOffset && shifted.gain > 0 &&
      static_cast<double>(Explained(samples, shifted)) >
          kOffsetsWorth * static_cast<double>(Explained(samples, best))) {
    best = shifted;
  }
  return best.gain >= kLeastGain && best.gain <= kGreatestGain ? best : Brightness{};
}

}  // namespace silhouette
