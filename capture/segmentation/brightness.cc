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

struct Sample {
  float grey = 0;
  float mean = 0;
  float tolerance = 0;

  bool ExplainedBy(float gain) const { return std::abs(grey - gain * mean) <= tolerance; }
};

std::vector<Sample> TakeSamples(const cv::Mat& grey, const Reference& reference) {
  constexpr float kUnit = 1.0F / Reference::kGreyLevel;
  const int stride =
      std::max(1, static_cast<int>(std::sqrt(static_cast<double>(grey.total()) / kSamples)));
  std::vector<Sample> samples;
  for (int y = stride / 2; y < grey.rows; y += stride) {
    const auto* image = grey.ptr<uint8_t>(y);
    const auto* mean = reference.mean().ptr<uint16_t>(y);
    const auto* noise = reference.noise().ptr<uint16_t>(y);
    for (int x = stride / 2; x < grey.cols; x += stride) {
      const Sample sample{.grey = static_cast<float>(image[x]),
                          .mean = kUnit * static_cast<float>(mean[x]),
                          .tolerance = std::max(1.0F, 3 * kUnit * static_cast<float>(noise[x]))};
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

}  // namespace

double BrightnessGain(const cv::Mat& grey, const Reference& reference) {
  const std::vector<Sample> samples = TakeSamples(grey, reference);
  if (samples.size() < kFewest) return 1;
  float best = 1;
  std::ptrdiff_t most = -1;
  for (float gain : Candidates(samples)) {
    const auto explained = std::count_if(samples.begin(), samples.end(), [&](const Sample& sample) {
      return sample.ExplainedBy(gain);
    });
    if (explained > most) {
      most = explained;
      best = gain;
    }
  }
  for (int i = 0; i < 2; ++i) best = Refine(samples, best);
  return best >= kLeastGain && best <= kGreatestGain ? best : 1;
}

}  // namespace silhouette
