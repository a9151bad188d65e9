#include "capture/segmentation/brightness.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace silhouette {
namespace {

constexpr int kSamples = 2000;      // about so many pixels tell the gain
constexpr size_t kFewest = 50;      // fewer tell nothing
constexpr int kCandidates = 40;     // gains that are tried
constexpr double kDarkest = 12;     // grey levels; darker pixels hardly change with the light
constexpr double kBrightest = 250;  // brighter ones may have been cut off
constexpr double kLeastGain = 0.5;
constexpr double kGreatestGain = 2;
constexpr double kGreatestOffset = 30;  // grey levels
// An offset must explain so many times the pixels that a gain alone does.
constexpr double kOffsetsWorth = 1.05;

struct Sample {
  float grey = 0;
  float mean = 0;
  float tolerance = 0;

  bool ExplainedBy(float gain, float offset = 0) const {
    return std::abs(grey - gain * mean - offset) <= tolerance;
  }
};

// Channels count as pixels of their own.
std::vector<Sample> TakeSamples(const cv::Mat& image, const Reference& reference,
                                const SlowLight& slow_light) {
  constexpr float kUnit = 1.0F / Reference::kGreyLevel;
  const int stride =
      std::max(1, static_cast<int>(std::sqrt(static_cast<double>(image.total()) / kSamples)));
  const int channels = image.channels();
  std::vector<Sample> samples;
  for (int y = stride / 2; y < image.rows; y += stride) {
    const auto* levels = image.ptr<uint8_t>(y);
    const auto* mean = reference.mean().ptr<uint16_t>(y);
    const auto* noise = reference.noise().ptr<uint16_t>(y);
    for (int x = stride / 2; x < image.cols; x += stride) {
      const int i = x * channels + x / stride % channels;
      if (noise[i] == Reference::kUndefined) continue;
      const auto slow = static_cast<float>(slow_light.At(x, y, image.size()));
      const Sample sample{.grey = static_cast<float>(levels[i]),
                          .mean = slow * kUnit * static_cast<float>(mean[i]),
                          .tolerance = std::max(1.0F, 3 * kUnit * static_cast<float>(noise[i]))};
      if (sample.mean >= kDarkest && sample.mean <= kBrightest && sample.grey <= kBrightest) {
        samples.push_back(sample);
      }
    }
  }
  return samples;
}

// Gains that single pixels speak for, densest where many agree; 1 comes first.
std::vector<float> Candidates(std::span<const Sample> samples) {
  std::vector<float> gains;
  for (const Sample& sample : samples) gains.push_back(sample.grey / sample.mean);
  std::sort(gains.begin(), gains.end());
  std::vector<float> candidates = {1};
  for (int i = 0; i < kCandidates; ++i) {
    const double place = (i + 0.5) / kCandidates * static_cast<double>(gains.size());
    candidates.push_back(gains[static_cast<size_t>(place)]);
  }
  return candidates;
}

// The gain of least squares over the samples that `gain` explains.
float Refine(std::span<const Sample> samples, float gain) {
  double product = 0;
  double square = 0;
  for (const Sample& sample : samples) {
    if (!sample.ExplainedBy(gain)) continue;
    product += sample.grey * sample.mean;
    square += sample.mean * sample.mean;
  }
  return square > 0 ? static_cast<float>(product / square) : gain;
}

std::ptrdiff_t Explained(std::span<const Sample> samples, const Brightness& light) {
  return std::count_if(samples.begin(), samples.end(), [&](const Sample& sample) {
    return sample.ExplainedBy(static_cast<float>(light.gain), static_cast<float>(light.offset));
  });
}

// The line of least squares through the samples that lie near one: begins with the gain that two
// quantiles of the pixels speak for.
Brightness WithOffset(std::span<const Sample> samples, Brightness light) {
  for (int i = 0; i < 5; ++i) {
    const float wide = i < 3 ? 3 : 1;  // so much further away than their tolerance may they lie
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (const Sample& sample : samples) {
      const double expected = light.gain * sample.mean + light.offset;
      if (std::abs(sample.grey - expected) > wide * sample.tolerance) continue;
      n += 1;
      x += sample.mean;
      y += sample.grey;
      xx += sample.mean * sample.mean;
      xy += sample.mean * sample.grey;
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
  const std::vector<Sample> samples = TakeSamples(image, reference, slow_light);
  if (samples.size() < kFewest) return {};
  Brightness best;
  std::ptrdiff_t most = -1;
  for (float gain : Candidates(samples)) {
    const Brightness light{.gain = gain};
    const auto explained = Explained(samples, light);
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
