#include "capture/segmentation/deviating_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

// The loops over the pixels of a row are written for the compiler to vectorise: no branches, no
// look-ups, narrow whole numbers.

namespace silhouette {
namespace {

constexpr int kSide = SegmentationSettings::kFaintSide;
constexpr int kReach = kSide / 2;
constexpr int kBrightest = 255 * kDifferenceUnit;  // a camera shows nothing brighter
// From the reference's units to kDifferenceUnit.
constexpr float kNoiseUnit = static_cast<float>(kDifferenceUnit) / Reference::kGreyLevel;

// A row of a box filter's input: what pixels that do not deviate by themselves contribute.
struct OpenRow {
  explicit OpenRow(size_t width) : difference(width), noise(width), open(width) {}

  std::vector<int16_t> difference;
  std::vector<uint16_t> noise;
  std::vector<uint8_t> open;  // 1, or 0: this pixel contributes nothing
};

// What single pixels say: sets `foreground` to 255 or 0, and what is open.
void JudgePixels(const uint8_t* __restrict image, const uint16_t* __restrict mean,
                 const uint16_t* __restrict noise, uint16_t gain, float noise_factor, float least,
                 int width, uint8_t* __restrict foreground, OpenRow& row) {
  int16_t* __restrict difference = row.difference.data();
  uint16_t* __restrict open_noise = row.noise.data();
  uint8_t* __restrict open = row.open.data();
  for (int x = 0; x < width; ++x) {
    const auto expected = static_cast<uint16_t>((static_cast<uint32_t>(mean[x]) * gain) >> 16);
    difference[x] =
        static_cast<int16_t>(image[x] * kDifferenceUnit - std::min<uint16_t>(expected, kBrightest));
  }
  for (int x = 0; x < width; ++x) {
    const float allowed =
        std::max(noise_factor * static_cast<float>(static_cast<int32_t>(noise[x])), least);
    const auto size = static_cast<float>(std::abs(static_cast<int32_t>(difference[x])));
    foreground[x] = size > allowed ? 255 : 0;
  }
  for (int x = 0; x < width; ++x) {
    const auto keep = static_cast<int16_t>(foreground[x] != 0 ? 0 : -1);
    difference[x] = static_cast<int16_t>(difference[x] & keep);
    open_noise[x] = static_cast<uint16_t>(noise[x] & keep);
    open[x] = static_cast<uint8_t>(keep & 1);
  }
}

// Sums over kSide rows, with kReach zeros on both sides of each.
class ColumnSums {
 public:
  explicit ColumnSums(int width)
      : width_(width),
        difference_(static_cast<size_t>(width) + 2 * kReach),
        noise_(difference_.size()),
        open_(difference_.size()) {}

  void Add(const OpenRow& row) { Accumulate<1>(row); }
  void Remove(const OpenRow& row) { Accumulate<-1>(row); }

  // Sets `foreground` where the mean of the pixels around deviates.
  void JudgeMeans(float noise_factor, float least, uint8_t* __restrict foreground) const {
    constexpr float kFewest = kSide * kSide / 2.0F;  // fewer pixels than that tell nothing
    const int32_t* __restrict difference = difference_.data();
    const int32_t* __restrict noise = noise_.data();
    const int32_t* __restrict open = open_.data();
    for (int x = 0; x < width_; ++x) {
      int32_t sum = 0;
      int32_t noises = 0;
      int32_t pixels = 0;
      for (int i = 0; i < kSide; ++i) {
        sum += difference[x + i];
        noises += noise[x + i];
        pixels += open[x + i];
      }
      const auto count = static_cast<float>(pixels);
      const auto size = static_cast<float>(std::abs(sum));
      const float noisy = noise_factor * static_cast<float>(noises);
      // The mean of `count` pixels has the noise of one over the root of `count`.
      const bool deviates =
          (count > kFewest) & (size > least * count) & (size * size * count > noisy * noisy);
      foreground[x] = static_cast<uint8_t>(foreground[x] | (deviates ? 255 : 0));
    }
  }

 private:
  template <int kSign>
  void Accumulate(const OpenRow& row) {
    const auto add = [this](const auto* __restrict from, int32_t* __restrict to) {
      for (int x = 0; x < width_; ++x) to[x] += kSign * from[x];
    };
    add(row.difference.data(), difference_.data() + kReach);
    add(row.noise.data(), noise_.data() + kReach);
    add(row.open.data(), open_.data() + kReach);
  }

  int width_;
  std::vector<int32_t> difference_;
  std::vector<int32_t> noise_;
  std::vector<int32_t> open_;
};

}  // namespace

uint16_t GainUnits(double gain) {
  return static_cast<uint16_t>(std::clamp<long>(std::lround(gain * kGainUnit), 0, 65535));
}

cv::Mat DeviatingPixels(const cv::Mat& grey, const Reference& reference, double gain,
                        const SegmentationSettings& settings) {
  const int width = grey.cols;
  const int height = grey.rows;
  const uint16_t units = GainUnits(gain);
  const auto noise_factor = static_cast<float>(settings.noise_factor) * kNoiseUnit;
  const auto least = static_cast<float>(settings.min_difference) * kDifferenceUnit;
  const auto faint = static_cast<float>(settings.faint_difference) * kDifferenceUnit;
  cv::Mat foreground(grey.size(), CV_8UC1);
  std::vector<OpenRow> rows(kSide, OpenRow(static_cast<size_t>(width)));  // row y is y % kSide
  ColumnSums sums(width);
  const auto row_of = [&rows](int y) -> OpenRow& { return rows[static_cast<size_t>(y % kSide)]; };
  // A row is judged by its surroundings as soon as the last row of these is there.
  for (int y = 0; y < height + kReach; ++y) {
    if (y >= kSide) sums.Remove(row_of(y));
    if (y < height) {
      JudgePixels(grey.ptr<uint8_t>(y), reference.mean().ptr<uint16_t>(y),
                  reference.noise().ptr<uint16_t>(y), units, noise_factor, least, width,
                  foreground.ptr<uint8_t>(y), row_of(y));
      sums.Add(row_of(y));
    }
    if (y >= kReach && y - kReach < height && faint > 0) {
      sums.JudgeMeans(noise_factor, faint, foreground.ptr<uint8_t>(y - kReach));
    }
  }
  return foreground;
}

}  // namespace silhouette
