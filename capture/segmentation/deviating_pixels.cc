#include "capture/segmentation/deviating_pixels.h"

#include <algorithm>
#include <cmath>
#include <vector>

// The loops over the values of a row are written for the compiler to vectorise: no branches, no
// look-ups, narrow whole numbers. A row of a colour image is three values per pixel.

namespace silhouette {
namespace {

constexpr int kGainUnit = 32768;
constexpr int kBrightest = 255 * kDifferenceUnit;  // a camera shows nothing brighter
// From the reference's units to kDifferenceUnit.
constexpr float kNoiseUnit = static_cast<float>(kDifferenceUnit) / Reference::kGreyLevel;
// Squares are those of 16ths of a grey level, of 64 grey levels at the most.
constexpr float kSquareUnit = 16;
constexpr int kMostSquared = 1023;
constexpr int kUnsteady = 3;  // times the typical noise

struct Limits {
  float noise_factor;  // for noise in the reference's units
  float least;         // of a single value; this and the next in kDifferenceUnit
  float faint;
  float squared_factor;   // of noise_factor, for squares
  float texture_squared;  // in squares' units
  int offset;             // in kDifferenceUnit
  int steady;             // squares of noisier values tell nothing; in the reference's units
};

Limits LimitsOf(const SegmentationSettings& settings, const Brightness& brightness,
                const Reference& reference) {
  const auto factor = static_cast<float>(settings.noise_factor);
  const auto texture = static_cast<float>(settings.texture_difference) * kSquareUnit;
  return {.noise_factor = factor * kNoiseUnit,
          .least = static_cast<float>(settings.min_difference) * kDifferenceUnit,
          .faint = static_cast<float>(settings.faint_difference) * kDifferenceUnit,
          .squared_factor = 2 * factor * factor,
          .texture_squared = texture * texture,
          .offset = static_cast<int>(std::lround(brightness.offset * kDifferenceUnit)),
          .steady = std::max(kUnsteady * reference.typical_noise(), Reference::kGreyLevel)};
}

// What the values that do not deviate by themselves contribute to sums over their surroundings.
struct OpenRow {
  explicit OpenRow(size_t values)
      : difference(values), noise(values), open(values), square(values), variance(values) {}

  std::vector<int16_t> difference;
  std::vector<uint16_t> noise;
  std::vector<uint8_t> open;  // 1, or 0: this value contributes nothing
  std::vector<int32_t> square;
  std::vector<int32_t> variance;
};

void FindDifferences(const uint8_t* __restrict image, const uint16_t* __restrict mean,
                     const uint16_t* __restrict gain, int offset, int values,
                     int16_t* __restrict difference) {
  constexpr int kSaturated = Reference::kSaturated * Reference::kGreyLevel;
  for (int i = 0; i < values; ++i) {
    const auto scaled = static_cast<int32_t>((static_cast<uint32_t>(mean[i]) * gain[i]) >> 16);
    const int32_t expected = std::min(std::max(scaled + offset, 0), kBrightest);
    const int32_t found = image[i] * kDifferenceUnit - expected;
    difference[i] = static_cast<int16_t>(mean[i] >= kSaturated ? std::min(found, 0) : found);
  }
}

// What single values say: `deviates` becomes 255 or 0.
void JudgeValues(const int16_t* __restrict difference, const uint16_t* __restrict noise,
                 const Limits& limits, int values, uint8_t* __restrict deviates) {
  const float factor = limits.noise_factor;
  const float least = limits.least;
  for (int i = 0; i < values; ++i) {
    const auto own = static_cast<int32_t>(noise[i]);
    const float allowed = std::max(factor * static_cast<float>(own), least);
    const auto size = static_cast<float>(std::abs(static_cast<int32_t>(difference[i])));
    deviates[i] = (size > allowed) | (own == Reference::kUndefined) ? 255 : 0;
  }
}

// Where a channel deviates the pixel does, with all its channels.
void UniteChannels(std::vector<uint8_t>& deviates, int pixels, uint8_t* __restrict foreground) {
  uint8_t* __restrict values = deviates.data();
  for (int x = 0; x < pixels; ++x) {
    const auto any = static_cast<uint8_t>(values[3 * x] | values[3 * x + 1] | values[3 * x + 2]);
    values[3 * x] = values[3 * x + 1] = values[3 * x + 2] = any;
    foreground[x] = static_cast<uint8_t>(foreground[x] | any);
  }
}

void KeepOpen(const uint8_t* __restrict deviates, const uint16_t* __restrict noise, int values,
              bool squares, int steady, OpenRow& row) {
  int16_t* __restrict difference = row.difference.data();
  uint16_t* __restrict open_noise = row.noise.data();
  uint8_t* __restrict open = row.open.data();
  for (int i = 0; i < values; ++i) {
    const auto keep = static_cast<int16_t>(deviates[i] != 0 ? 0 : -1);
    difference[i] = static_cast<int16_t>(difference[i] & keep);
    open_noise[i] = static_cast<uint16_t>(noise[i] & keep);
    open[i] = static_cast<uint8_t>(keep & 1);
  }
  if (!squares) return;
  int32_t* __restrict square = row.square.data();
  int32_t* __restrict variance = row.variance.data();
  for (int i = 0; i < values; ++i) {
    const int32_t size = std::min(std::abs(static_cast<int32_t>(difference[i])) >> 3, kMostSquared);
    const int32_t own = std::min(static_cast<int32_t>(open_noise[i]) >> 4, kMostSquared);
    const int32_t counts = open_noise[i] <= steady ? 1 : 0;
    square[i] = counts * size * size;
    variance[i] = counts * own * own;
  }
}

// Sums over the rows around one, with room for zeros on both sides of each.
class ColumnSums {
 public:
  ColumnSums(int values, int reach, int channels)
      : values_(values),
        channels_(channels),
        margin_(reach * channels),
        difference_(static_cast<size_t>(values + 2 * margin_)),
        noise_(difference_.size()),
        open_(difference_.size()),
        square_(difference_.size()),
        variance_(difference_.size()) {}

  template <int kSign>
  void Add(const OpenRow& row, bool squares) {
    const auto add = [this](const auto* __restrict from, std::vector<int32_t>& sums) {
      int32_t* __restrict to = sums.data() + margin_;
      for (int i = 0; i < values_; ++i) to[i] += kSign * from[i];
    };
    add(row.difference.data(), difference_);
    add(row.noise.data(), noise_);
    add(row.open.data(), open_);
    if (!squares) return;
    add(row.square.data(), square_);
    add(row.variance.data(), variance_);
  }

  // `deviates` becomes 255 where the mean of the values around deviates, else 0.
  template <int kReach>
  void JudgeMeans(const Limits& limits, uint8_t* __restrict deviates) const {
    constexpr int kSide = 2 * kReach + 1;
    constexpr float kFewest = kSide * kSide / 2.0F;  // fewer values than that tell nothing
    const int32_t* __restrict difference = difference_.data();
    const int32_t* __restrict noise = noise_.data();
    const int32_t* __restrict open = open_.data();
    const int channels = channels_;
    const float factor = limits.noise_factor;
    // A limit of 0 is none.
    const float least = limits.faint > 0 ? limits.faint : 1e9F;
    for (int i = 0; i < values_; ++i) {
      int32_t sum = 0;
      int32_t noises = 0;
      int32_t values = 0;
      for (int k = 0; k < kSide; ++k) {
        sum += difference[i + k * channels];
        noises += noise[i + k * channels];
        values += open[i + k * channels];
      }
      const auto count = static_cast<float>(values);
      const auto size = static_cast<float>(std::abs(sum));
      const float noisy = factor * static_cast<float>(noises);
      // The mean of `count` values has the noise of one over the root of `count`.
      deviates[i] =
          (count > kFewest) & (size > least * count) & (size * size * count > noisy * noisy) ? 255
                                                                                             : 0;
    }
    if (limits.texture_squared > 0) JudgeSquares<kReach>(limits, deviates);
  }

 private:
  template <int kReach>
  void JudgeSquares(const Limits& limits, uint8_t* __restrict deviates) const {
    constexpr int kSide = 2 * kReach + 1;
    constexpr float kFewest = kSide * kSide / 2.0F;
    const int32_t* __restrict square = square_.data();
    const int32_t* __restrict variance = variance_.data();
    const int32_t* __restrict open = open_.data();
    const int channels = channels_;
    const float factor = limits.squared_factor;
    const float least = limits.texture_squared;
    for (int i = 0; i < values_; ++i) {
      int32_t squares = 0;
      int32_t variances = 0;
      int32_t values = 0;
      for (int k = 0; k < kSide; ++k) {
        squares += square[i + k * channels];
        variances += variance[i + k * channels];
        values += open[i + k * channels];
      }
      const auto count = static_cast<float>(values);
      const auto expected = static_cast<float>(variances);
      const float beyond = static_cast<float>(squares) - expected;
      // The sum of the squares of `count` normal values of variance v has the variance 2 count v^2.
      const bool texture = (count > kFewest) & (beyond > least * count) &
                           (beyond * beyond * count > factor * expected * expected);
      deviates[i] = static_cast<uint8_t>(deviates[i] | (texture ? 255 : 0));
    }
  }

  int values_;
  int channels_;
  int margin_;
  std::vector<int32_t> difference_;
  std::vector<int32_t> noise_;
  std::vector<int32_t> open_;
  std::vector<int32_t> square_;
  std::vector<int32_t> variance_;
};

void JudgeMeans(const ColumnSums& sums, int reach, const Limits& limits, uint8_t* deviates) {
  static_assert(SegmentationSettings::kMostFaintSide == 15);
  switch (reach) {
    case 1:
      return sums.JudgeMeans<1>(limits, deviates);
    case 2:
      return sums.JudgeMeans<2>(limits, deviates);
    case 3:
      return sums.JudgeMeans<3>(limits, deviates);
    case 4:
      return sums.JudgeMeans<4>(limits, deviates);
    case 5:
      return sums.JudgeMeans<5>(limits, deviates);
    case 6:
      return sums.JudgeMeans<6>(limits, deviates);
    default:
      return sums.JudgeMeans<7>(limits, deviates);
  }
}

// The gains of a row's values, in 32768ths.
class Gains {
 public:
  Gains(cv::Size size, int channels, double gain, const SlowLight& slow_light)
      : size_(size),
        channels_(channels),
        gain_(gain),
        slow_light_(slow_light),
        factors_(static_cast<size_t>(slow_light.none() ? 0 : size.width)),
        units_(static_cast<size_t>(size.width * channels), GainUnits(gain)) {}

  const uint16_t* Row(int y) {
    if (slow_light_.none()) return units_.data();
    slow_light_.Row(y, size_, factors_);
    const auto unit = static_cast<float>(gain_ * kGainUnit);
    for (float& factor : factors_) factor = std::min(factor * unit + 0.5F, 65535.0F);
    const auto step = static_cast<size_t>(channels_);
    for (size_t c = 0; c < step; ++c) {
      for (size_t x = 0; x < factors_.size(); ++x) {
        units_[x * step + c] = static_cast<uint16_t>(static_cast<int32_t>(factors_[x]));
      }
    }
    return units_.data();
  }

 private:
  const cv::Size size_;
  const int channels_;
  const double gain_;
  const SlowLight& slow_light_;
  std::vector<float> factors_;
  std::vector<uint16_t> units_;
};

}  // namespace

uint16_t GainUnits(double gain) {
  return static_cast<uint16_t>(std::clamp(gain * kGainUnit + 0.5, 0.0, 65535.0));
}

cv::Mat DeviatingPixels(const cv::Mat& image, const Reference& reference,
                        const Brightness& brightness, const SlowLight& slow_light,
                        const SegmentationSettings& settings) {
  const int channels = image.channels();
  const int values = image.cols * channels;
  const int side = settings.faint_side;
  const int reach = side / 2;
  const bool squares = settings.texture_difference > 0;
  const bool means = squares || settings.faint_difference > 0;
  const Limits limits = LimitsOf(settings, brightness, reference);
  Gains gains(image.size(), channels, brightness.gain, slow_light);
  cv::Mat foreground(image.size(), CV_8UC1, cv::Scalar(0));
  // Row y is y % side.
  std::vector<OpenRow> rows(static_cast<size_t>(side), OpenRow(static_cast<size_t>(values)));
  const auto row_of = [&](int y) -> OpenRow& { return rows[static_cast<size_t>(y % side)]; };
  ColumnSums sums(values, reach, channels);
  std::vector<uint8_t> deviates(static_cast<size_t>(values));
  const auto mark = [&](int y) {
    auto* row = foreground.ptr<uint8_t>(y);
    if (channels == 3) return UniteChannels(deviates, image.cols, row);
    for (int x = 0; x < values; ++x)
      row[x] = static_cast<uint8_t>(row[x] | deviates[static_cast<size_t>(x)]);
  };
  // A row is judged by its surroundings as soon as the last row of these is there.
  for (int y = 0; y < image.rows + reach; ++y) {
    if (means && y >= side) sums.Add<-1>(row_of(y), squares);
    if (y < image.rows) {
      OpenRow& row = row_of(y);
      const auto* noise = reference.noise().ptr<uint16_t>(y);
      FindDifferences(image.ptr<uint8_t>(y), reference.mean().ptr<uint16_t>(y), gains.Row(y),
                      limits.offset, values, row.difference.data());
      JudgeValues(row.difference.data(), noise, limits, values, deviates.data());
      mark(y);
      if (means) {
        KeepOpen(deviates.data(), noise, values, squares, limits.steady, row);
        sums.Add<1>(row, squares);
      }
    }
    if (means && y >= reach && y - reach < image.rows) {
      JudgeMeans(sums, reach, limits, deviates.data());
      mark(y - reach);
    }
  }
  return foreground;
}

}  // namespace silhouette
