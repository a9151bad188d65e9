// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/shadows.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "capture/segmentation/deviating_pixels.h"

namespace silhouette {
namespace {

constexpr int kSide = 9;                 // of the surroundings that are looked at
constexpr float kShadowsDarkest = 0.3F;  // a shadow leaves so much of the light
constexpr float kFaintest = 0.99F;
// Residuals may be this many standard deviations above what noise alone makes.
constexpr float kResidual = 5;
// Systematic errors of the expected image, share of it.
constexpr float kModelError = 0.006F;
// By how much, in noise variances, one colour must fit worse than the cell's texture.
constexpr float kEvidence = 40;
// Rounds in which pixels between such join them.
constexpr int kRounds = 4;
// Share of the foreground around that is certain, for pixels between.
constexpr double kShadowsEnough = 0.4;
// Standard deviations: of a pixel that counts as evidence, and of single pixels beside a shadow.
constexpr float kDarker = 3;
constexpr float kTolerance = 4;

// Sums over channels, for every pixel by itself, 0 where it is no candidate.
struct Terms {
  explicit Terms(cv::Size size, int channels)
      : candidate(cv::Mat::zeros(size, CV_8UC1)),
        count(zeros(size)),
        ee(zeros(size)),
        ie(zeros(size)),
        ii(zeros(size)),
        variance(zeros(size)) {
    for (int c = 0; c < channels; ++c) levels.push_back(zeros(size));
  }
  static cv::Mat zeros(cv::Size size) { return cv::Mat::zeros(size, CV_32FC1); }

  cv::Mat candidate;
  cv::Mat count;
  cv::Mat ee;                   // expected squared
  cv::Mat ie;                   // image times expected
  cv::Mat ii;                   // image squared
  cv::Mat variance;             // of the noise
  std::vector<cv::Mat> levels;  // image, by channel
};

class Expected {
 public:
  Expected(const cv::Mat& image, const Reference& reference, const Brightness& brightness,
           const SlowLight& slow_light)
      : image_(image),
        reference_(reference),
        brightness_(brightness),
        slow_light_(slow_light),
        factors_(static_cast<size_t>(image.cols), 1) {}

  void Go(int y) {
    mean_ = reference_.mean().ptr<uint16_t>(y);
    noise_ = reference_.noise().ptr<uint16_t>(y);
    levels_ = image_.ptr<uint8_t>(y);
    if (!slow_light_.none()) slow_light_.Row(y, image_.size(), factors_);
  }
  // Of a channel's value `i` = x * channels + channel.
  float Level(int x, int i) const {
    const auto gain = static_cast<float>(brightness_.gain) * factors_[static_cast<size_t>(x)];
    return gain * kUnit * static_cast<float>(mean_[i]) + static_cast<float>(brightness_.offset);
  }
  float Noise(int i) const { return std::max(kUnit * static_cast<float>(noise_[i]), 0.5F); }
  float Seen(int i) const { return static_cast<float>(levels_[i]); }
  bool Usable(int i) const {
    return mean_[i] < Reference::kSaturated * Reference::kGreyLevel &&
           noise_[i] != Reference::kUndefined;
  }

 private:
  static constexpr float kUnit = 1.0F / Reference::kGreyLevel;
  const cv::Mat& image_;
  const Reference& reference_;
  const Brightness& brightness_;
  const SlowLight& slow_light_;
  std::vector<float> factors_;
  const uint16_t* mean_ = nullptr;
  const uint16_t* noise_ = nullptr;
  const uint8_t* levels_ = nullptr;
};

// Whether a pixel is clearly darker than expected.
bool IsDarker(const Expected& expected, int x, int channels) {
  for (int i = x * channels; i < (x + 1) * channels; ++i) {
    if (expected.Level(x, i) - expected.Seen(i) > kDarker * expected.Noise(i)) return true;
  }
  return false;
}

// Whether all channels of a pixel are darker than expected, but not too dark.
bool IsCandidate(const Expected& expected, int x, int channels) {
  for (int c = 0; c < channels; ++c) {
    const int i = x * channels + c;
    if (!expected.Usable(i)) return false;
    const float level = expected.Level(x, i);
    const float slack = kTolerance * expected.Noise(i);
    if (expected.Seen(i) > level + slack || expected.Seen(i) < kShadowsDarkest * level - slack) {
      return false;
    }
  }
  return true;
}

// 255 where the foreground reaches into the empty cell beside it: within half a window of whole
// windows without foreground. Single holes are in things, too.
cv::Mat NearTheCell(const cv::Mat& foreground) {
  const auto window = [](int side) {
    return cv::getStructuringElement(cv::MORPH_RECT, {side, side});
  };
  cv::Mat near;
  cv::erode(foreground == 0, near, window(kSide));
  cv::dilate(near, near, window(2 * kSide - 1));
  return near;
}

// What is not darker than the cell counts for nothing, and is no candidate within a shadow: a thing
// as bright as the cell may stand there.
Terms TermsOf(Expected& expected, const cv::Mat& foreground, int channels) {
  Terms terms(foreground.size(), channels);
  const cv::Mat near = NearTheCell(foreground);
  for (int y = 0; y < foreground.rows; ++y) {
    expected.Go(y);
    const auto* marked = foreground.ptr<uint8_t>(y);
    for (int x = 0; x < foreground.cols; ++x) {
      if (marked[x] == 0 || !IsCandidate(expected, x, channels)) continue;
      const bool darker = IsDarker(expected, x, channels);
      if (darker || near.at<uint8_t>(y, x) != 0) terms.candidate.at<uint8_t>(y, x) = 255;
      if (!darker) continue;
      terms.count.at<float>(y, x) = 1;
      for (int c = 0; c < channels; ++c) {
        const int i = x * channels + c;
        const float level = expected.Level(x, i);
        const float seen = expected.Seen(i);
        const float error = kModelError * level;
        terms.ee.at<float>(y, x) += level * level;
        terms.ie.at<float>(y, x) += seen * level;
        terms.ii.at<float>(y, x) += seen * seen;
        terms.variance.at<float>(y, x) += expected.Noise(i) * expected.Noise(i) + error * error;
        terms.levels[static_cast<size_t>(c)].at<float>(y, x) = seen;
      }
    }
  }
  return terms;
}

void SumAround(cv::Mat& image) {
  cv::boxFilter(image, image, CV_32F, {kSide, kSide}, {-1, -1}, false, cv::BORDER_CONSTANT);
}

// The factor of the shadow around each pixel that is in one for certain, else 0.
cv::Mat CertainFactors(Terms& terms) {
  for (cv::Mat* sum : {&terms.count, &terms.ee, &terms.ie, &terms.ii, &terms.variance}) {
    SumAround(*sum);
  }
  for (cv::Mat& sum : terms.levels) SumAround(sum);
  const auto channels = static_cast<float>(terms.levels.size());
  cv::Mat factors = cv::Mat::zeros(terms.count.size(), CV_32FC1);
  for (int y = 0; y < factors.rows; ++y) {
    for (int x = 0; x < factors.cols; ++x) {
      const float count = terms.count.at<float>(y, x);
      if (terms.candidate.at<uint8_t>(y, x) == 0 || count < kSide * kSide / 3.0F) continue;
      const float factor = terms.ie.at<float>(y, x) / terms.ee.at<float>(y, x);
      if (factor < kShadowsDarkest || factor > kFaintest) continue;
      const float ii = terms.ii.at<float>(y, x);
      // What is left of the image by either explanation.
      const float shadow = ii - factor * terms.ie.at<float>(y, x);
      float surface = ii;
      for (const cv::Mat& level : terms.levels) {
        surface -= level.at<float>(y, x) * level.at<float>(y, x) / count;
      }
      const float variance = terms.variance.at<float>(y, x);
      const float values = count * channels;
      const float allowed = variance * (1 + kResidual * std::sqrt(2 / values));
      if (shadow > allowed || surface - shadow < kEvidence * variance / values) continue;
      factors.at<float>(y, x) = factor;
    }
  }
  return factors;
}

// 255 where enough of the foreground around is certain to be in a shadow.
cv::Mat Among(const cv::Mat& factors, const cv::Mat& foreground) {
  cv::Mat certain;
  cv::Mat all;
  cv::Mat(factors > 0).convertTo(certain, CV_32F);
  cv::Mat(foreground > 0).convertTo(all, CV_32F);
  SumAround(certain);
  SumAround(all);
  return certain >= kShadowsEnough * all;
}

// The least factor of a certain shadow within reach; 2: there is none.
cv::Mat LeastNear(const cv::Mat& factors) {
  cv::Mat least = factors.clone();
  least.setTo(2, factors == 0);
  cv::erode(least, least, cv::getStructuringElement(cv::MORPH_RECT, {kSide, kSide}));
  return least;
}

}  // namespace

FoundShadows FindShadows(const cv::Mat& image, const Reference& reference,
                         const Brightness& brightness, const SlowLight& slow_light,
                         const cv::Mat& foreground) {
  const int channels = image.channels();
  Expected expected(image, reference, brightness, slow_light);
  Terms terms = TermsOf(expected, foreground, channels);
  if (cv::countNonZero(terms.candidate) == 0) return {terms.candidate, terms.candidate};
  cv::Mat factors = CertainFactors(terms);
  for (int round = 0; round < kRounds; ++round) {
    const cv::Mat least = LeastNear(factors);
    const cv::Mat among = Among(factors, foreground);
    for (int y = 0; y < image.rows; ++y) {
      expected.Go(y);
      for (int x = 0; x < image.cols; ++x) {
        const float factor = least.at<float>(y, x);
        if (among.at<uint8_t>(y, x) == 0 || terms.candidate.at<uint8_t>(y, x) == 0) continue;
        if (factor > 1 || factors.at<float>(y, x) > 0) continue;
        bool within = true;
        for (int i = x * channels; i < (x + 1) * channels; ++i) {
          const float darkest = factor * expected.Level(x, i) - kTolerance * expected.Noise(i);
          within &= expected.Seen(i) >= darkest;
        }
        if (within) factors.at<float>(y, x) = factor;
      }
    }
  }
  return {factors > 0, terms.candidate};
}

}  // namespace silhouette
