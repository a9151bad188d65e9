// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/deviating_pixels.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "db/mask/wider_vectors.h"

// The loops over the values of a row are written for the compiler to vectorise: no branches, no
// look-ups, narrow whole numbers. A row of a colour image is three values per pixel.
// With AVX2 the results are the same: there are no fused multiplications.

namespace silhouette {
namespace {

// Differences are counted in these parts of a grey level, so that all of them fit into 16 bits.
constexpr int kDifferenceUnit = 128;

constexpr int kGainUnit = 32768;

// By what the reference's mean is multiplied to be expected in an image, in 32768ths.
uint16_t GainUnits(double gain) {
  return static_cast<uint16_t>(std::clamp(gain * kGainUnit + 0.5, 0.0, 65535.0));
}

// The settings in the units that values are counted in.
struct DeviationLimits {
  float noise_factor = 0;  // for noise in the reference's units
  float least = 0;         // of a single value; this and the next in kDifferenceUnit-ths
  float faint = 0;
  float squared_factor = 0;   // of noise_factor, for squares
  float texture_squared = 0;  // in squares' units
  int offset = 0;             // in kDifferenceUnit-ths
  int steady = 0;             // squares of noisier values tell nothing; in the reference's units
};

// What the values of a row that do not deviate by themselves, the open ones, contribute to sums
// over surroundings. Of others all is 0.
struct OpenRow {
  explicit OpenRow(size_t values)
      : difference(values), counted(values), square(values), variance(values) {}

  // Noise and number in one: bits that hold the sum of the noise of any surroundings.
  static constexpr int kNoiseBits = 24;
  static_assert(int64_t{SegmentationSettings::kMostFaintSide} *
                    SegmentationSettings::kMostFaintSide * Reference::kUndefined <
                int64_t{1} << kNoiseBits);

  std::vector<int16_t> difference;  // kDifferenceUnit-ths
  std::vector<uint32_t> counted;    // the reference's noise, and 1 << kNoiseBits
  std::vector<int32_t> square;      // of differences, and of noise
  std::vector<int32_t> variance;
};

constexpr int kOpenValuesBrightest = 255 * kDifferenceUnit;  // a camera shows nothing brighter
// From the reference's units to kDifferenceUnit-ths.
constexpr float kNoiseUnit = static_cast<float>(kDifferenceUnit) / Reference::kGreyLevel;
// Squares are those of 16ths of a grey level, of 64 grey levels at the most.
constexpr float kSquareUnit = 16;
constexpr int16_t kOpenValuesMostSquared = 1023;
constexpr int kOpenValuesUnsteady = 3;  // times the typical noise

DeviationLimits LimitsOf(const SegmentationSettings& settings, const Brightness& brightness,
                         const Reference& reference) {
  const auto factor = static_cast<float>(settings.noise_factor);
  const auto texture = static_cast<float>(settings.texture_difference) * kSquareUnit;
  return {
      .noise_factor = factor * kNoiseUnit,
      .least = static_cast<float>(settings.min_difference) * kDifferenceUnit,
      .faint = static_cast<float>(settings.faint_difference) * kDifferenceUnit,
      .squared_factor = 2 * factor * factor,
      .texture_squared = texture * texture,
      .offset = static_cast<int>(std::lround(brightness.offset * kDifferenceUnit)),
      .steady = std::max(kOpenValuesUnsteady * reference.typical_noise(), Reference::kGreyLevel)};
}

// The differences of a row to the expected levels: `mean` times `gain` (GainUnits()) plus `offset`.
SILHOUETTE_WIDER_VECTORS void FindDifferences(const uint8_t* __restrict image,
                                              const uint16_t* __restrict mean,
                                              const uint16_t* __restrict gain, int offset,
                                              int values, int16_t* __restrict difference) {
  constexpr uint16_t kSaturated = Reference::kSaturated * Reference::kGreyLevel;
  // What is expected is within 0 and kOpenValuesBrightest: so much may it be before the offset is
  // added.
  const auto least = static_cast<uint16_t>(std::clamp(-offset, 0, 65535));
  const auto most = static_cast<uint16_t>(std::clamp(kOpenValuesBrightest - offset, 0, 65535));
  const auto more = static_cast<uint16_t>(offset);
  for (int i = 0; i < values; ++i) {
    const auto scaled = static_cast<uint16_t>((static_cast<uint32_t>(mean[i]) * gain[i]) >> 16);
    const uint16_t within = std::min(std::max(scaled, least), most);
    const auto expected = static_cast<uint16_t>(within + more);
    const auto found = static_cast<int16_t>(image[i] * kDifferenceUnit - expected);
    difference[i] = mean[i] >= kSaturated ? std::min<int16_t>(found, 0) : found;
  }
}

// Judges single values: `deviates` becomes kStrongEvidence or 0.
SILHOUETTE_WIDER_VECTORS void JudgeValues(const int16_t* __restrict difference,
                                          const uint16_t* __restrict noise,
                                          const DeviationLimits& limits, int values,
                                          uint8_t* __restrict deviates) {
  const float factor = limits.noise_factor;
  const float least = limits.least;
  for (int i = 0; i < values; ++i) {
    const auto own = static_cast<int32_t>(noise[i]);
    const float allowed = std::max(factor * static_cast<float>(own), least);
    const auto size = static_cast<float>(std::abs(static_cast<int32_t>(difference[i])));
    deviates[i] = (size > allowed) | (own == Reference::kUndefined) ? kStrongEvidence : 0;
  }
}

// Makes `row`, whose differences are those of FindDifferences(), the contribution of the values
// that do not deviate; its squares only if `squares`.
SILHOUETTE_WIDER_VECTORS void KeepOpen(const uint8_t* __restrict deviates,
                                       const uint16_t* __restrict noise, int values, bool squares,
                                       int steady, OpenRow& row) {
  int16_t* __restrict difference = row.difference.data();
  uint32_t* __restrict counted = row.counted.data();
  for (int i = 0; i < values; ++i) {
    const int32_t keep = deviates[i] != 0 ? 0 : -1;
    difference[i] = static_cast<int16_t>(difference[i] & keep);
    counted[i] = (noise[i] | (1U << OpenRow::kNoiseBits)) & static_cast<uint32_t>(keep);
  }
  if (!squares) return;
  int32_t* __restrict square = row.square.data();
  int32_t* __restrict variance = row.variance.data();
  for (int i = 0; i < values; ++i) {
    const bool counts = (deviates[i] == 0) & (noise[i] <= steady);
    const auto keep = static_cast<int16_t>(counts ? -1 : 0);
    const auto size = static_cast<int16_t>(std::abs(difference[i]) >> 3);
    const auto own = static_cast<int16_t>(noise[i] >> 4);
    const auto difference_size =
        static_cast<int16_t>(std::min(size, kOpenValuesMostSquared) & keep);
    const auto noise_size = static_cast<int16_t>(std::min(own, kOpenValuesMostSquared) & keep);
    square[i] = int32_t{difference_size} * difference_size;
    variance[i] = int32_t{noise_size} * noise_size;
  }
}

template <typename Value, typename Sum>
[[gnu::always_inline]] inline void AddAll(const Value* __restrict in, const Value* __restrict out,
                                          size_t values, Sum* __restrict sums) {
  if (in != nullptr && out != nullptr) {
    for (size_t i = 0; i < values; ++i) sums[i] += static_cast<Sum>(in[i] - out[i]);
  } else if (in != nullptr) {
    for (size_t i = 0; i < values; ++i) sums[i] += static_cast<Sum>(in[i]);
  } else if (out != nullptr) {
    for (size_t i = 0; i < values; ++i) sums[i] -= static_cast<Sum>(out[i]);
  }
}

SILHOUETTE_WIDER_VECTORS void Add(const int16_t* in, const int16_t* out, size_t values,
                                  int32_t* sums) {
  AddAll(in, out, values, sums);
}
SILHOUETTE_WIDER_VECTORS void Add(const int32_t* in, const int32_t* out, size_t values,
                                  int32_t* sums) {
  AddAll(in, out, values, sums);
}
SILHOUETTE_WIDER_VECTORS void Add(const uint32_t* in, const uint32_t* out, size_t values,
                                  uint32_t* sums) {
  AddAll(in, out, values, sums);
}

template <int kSide, typename Sum>
[[gnu::always_inline]] inline void SumSide(const Sum* __restrict columns, int channels, int values,
                                           Sum* __restrict sums) {
  for (int i = 0; i < values; ++i) {
    Sum sum = 0;
    for (int k = 0; k < kSide; ++k) sum += columns[i + k * channels];
    sums[i] = sum;
  }
}

template <typename Sum>
[[gnu::always_inline]] inline void SumSides(int reach, const Sum* columns, int channels, int values,
                                            Sum* sums) {
  static_assert(SegmentationSettings::kMostFaintSide == 15);
  switch (reach) {
    case 1:
      return SumSide<3>(columns, channels, values, sums);
    case 2:
      return SumSide<5>(columns, channels, values, sums);
    case 3:
      return SumSide<7>(columns, channels, values, sums);
    case 4:
      return SumSide<9>(columns, channels, values, sums);
    case 5:
      return SumSide<11>(columns, channels, values, sums);
    case 6:
      return SumSide<13>(columns, channels, values, sums);
    default:
      return SumSide<15>(columns, channels, values, sums);
  }
}

SILHOUETTE_WIDER_VECTORS void SumAcross(int reach, const int32_t* columns, int channels, int values,
                                        int32_t* sums) {
  SumSides(reach, columns, channels, values, sums);
}
SILHOUETTE_WIDER_VECTORS void SumAcross(int reach, const uint32_t* columns, int channels,
                                        int values, uint32_t* sums) {
  SumSides(reach, columns, channels, values, sums);
}

int32_t NumberIn(uint32_t counted) { return static_cast<int32_t>(counted >> OpenRow::kNoiseBits); }
int32_t NoiseIn(uint32_t counted) {
  return static_cast<int32_t>(counted & ((1U << OpenRow::kNoiseBits) - 1));
}

SILHOUETTE_WIDER_VECTORS void JudgeMeans(const int32_t* __restrict differences,
                                         const uint32_t* __restrict counted,
                                         const DeviationLimits& limits, int side, int values,
                                         uint8_t* __restrict deviates) {
  const float fewest = static_cast<float>(side * side) / 2;  // fewer values than that tell nothing
  const float factor = limits.noise_factor;
  const float least = limits.faint > 0 ? limits.faint : 1e9F;  // a limit of 0 is none
  for (int i = 0; i < values; ++i) {
    const auto count = static_cast<float>(NumberIn(counted[i]));
    const auto size = static_cast<float>(std::abs(differences[i]));
    const float noisy = factor * static_cast<float>(NoiseIn(counted[i]));
    // The mean of `count` values has the noise of one over the root of `count`.
    const bool mean =
        (count > fewest) & (size > least * count) & (size * size * count > noisy * noisy);
    const bool strong = size > kStrongFactor * least * count;
    deviates[i] = static_cast<uint8_t>(mean ? (strong ? kStrongEvidence : kWeakEvidence) : 0);
  }
}

SILHOUETTE_WIDER_VECTORS void JudgeSquares(const int32_t* __restrict squares,
                                           const int32_t* __restrict variances,
                                           const uint32_t* __restrict counted,
                                           const DeviationLimits& limits, int side, int values,
                                           uint8_t* __restrict deviates) {
  const float fewest = static_cast<float>(side * side) / 2;
  const float factor = limits.squared_factor;
  const float least = limits.texture_squared;
  const float strong_least = kStrongFactor * kStrongFactor * least;
  for (int i = 0; i < values; ++i) {
    const auto count = static_cast<float>(NumberIn(counted[i]));
    const auto variance = static_cast<float>(variances[i]);
    const auto beyond = static_cast<float>(squares[i] - variances[i]);
    // The mean of `count` squares has the noise of one, root 2 of the variance, over the root.
    const bool texture = (count > fewest) & (beyond > least * count) &
                         (beyond * beyond * count > factor * variance * variance);
    const bool strong = beyond > strong_least * count;
    const int found = texture ? (strong ? kStrongEvidence : kWeakEvidence) : 0;
    deviates[i] = static_cast<uint8_t>(deviates[i] | found);
  }
}

// Sums over the rows around one.
class Surroundings {
 public:
  // Rows have `values` values, `channels` per pixel; `reach` pixels on all sides are surroundings,
  // 1 to 7. Squares are summed only if `squares`.
  Surroundings(int values, int channels, int reach, bool squares);

  // A row comes in, one goes: null if there is none.
  void Move(const OpenRow* in, const OpenRow* out);

  // `deviates` becomes the evidence of the values around, in their mean or in their squares, as
  // DeviatingPixels() says, else 0.
  void Judge(const DeviationLimits& limits, uint8_t* deviates);

 private:
  // Sums over columns, with room for zeros on both sides, and, over those, sums across.
  template <typename Sum>
  struct Sums {
    std::vector<Sum> columns;
    std::vector<Sum> around;
  };

  int values_;
  int channels_;
  int reach_;
  bool squares_;
  Sums<int32_t> difference_;
  Sums<uint32_t> counted_;
  Sums<int32_t> square_;
  Sums<int32_t> variance_;
};

Surroundings::Surroundings(int values, int channels, int reach, bool squares)
    : values_(values), channels_(channels), reach_(reach), squares_(squares) {
  const auto around = static_cast<size_t>(values);
  const size_t columns = around + static_cast<size_t>(2 * reach * channels);
  difference_ = {std::vector<int32_t>(columns), std::vector<int32_t>(around)};
  counted_ = {std::vector<uint32_t>(columns), std::vector<uint32_t>(around)};
  if (squares) square_ = variance_ = difference_;
}

void Surroundings::Move(const OpenRow* in, const OpenRow* out) {
  const auto move = [&](auto OpenRow::*part, auto& sums) {
    Add(in == nullptr ? nullptr : (in->*part).data(),
        out == nullptr ? nullptr : (out->*part).data(), static_cast<size_t>(values_),
        sums.columns.data() + reach_ * channels_);
  };
  move(&OpenRow::difference, difference_);
  move(&OpenRow::counted, counted_);
  if (!squares_) return;
  move(&OpenRow::square, square_);
  move(&OpenRow::variance, variance_);
}

void Surroundings::Judge(const DeviationLimits& limits, uint8_t* deviates) {
  const auto sum = [this](auto& sums) {
    SumAcross(reach_, sums.columns.data(), channels_, values_, sums.around.data());
    return sums.around.data();
  };
  const int side = 2 * reach_ + 1;
  const uint32_t* counted = sum(counted_);
  JudgeMeans(sum(difference_), counted, limits, side, values_, deviates);
  if (!squares_) return;
  const int32_t* squares = sum(square_);
  JudgeSquares(squares, sum(variance_), counted, limits, side, values_, deviates);
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

cv::Mat DeviatingPixels(const cv::Mat& image, const Reference& reference,
                        const Brightness& brightness, const SlowLight& slow_light,
                        const SegmentationSettings& settings) {
  const int channels = image.channels();
  const int values = image.cols * channels;
  const int side = settings.faint_side;
  const int reach = side / 2;
  const bool squares = settings.texture_difference > 0;
  const bool means = squares || settings.faint_difference > 0;
  const DeviationLimits limits = LimitsOf(settings, brightness, reference);
  Gains gains(image.size(), channels, brightness.gain, slow_light);
  cv::Mat foreground(image.size(), CV_8UC1, cv::Scalar(0));
  // Row y is y % (side + 1): those around a row, and the one that has just gone.
  std::vector<OpenRow> rows(static_cast<size_t>(side) + 1, OpenRow(static_cast<size_t>(values)));
  const auto row_of = [&](int y) { return &rows[static_cast<size_t>(y % (side + 1))]; };
  Surroundings surroundings(values, channels, reach, squares);
  std::vector<uint8_t> deviates(static_cast<size_t>(values));
  const auto mark = [&](int y) {
    auto* row = foreground.ptr<uint8_t>(y);
    if (channels == 3) return UniteChannels(deviates, image.cols, row);
    for (int x = 0; x < values; ++x) {
      row[x] = static_cast<uint8_t>(row[x] | deviates[static_cast<size_t>(x)]);
    }
  };
  // A row is judged by its surroundings as soon as the last row of these is there.
  for (int y = 0; y < image.rows + reach; ++y) {
    const bool comes = y < image.rows;
    if (comes) {
      OpenRow& row = *row_of(y);
      const auto* noise = reference.noise().ptr<uint16_t>(y);
      FindDifferences(image.ptr<uint8_t>(y), reference.mean().ptr<uint16_t>(y), gains.Row(y),
                      limits.offset, values, row.difference.data());
      JudgeValues(row.difference.data(), noise, limits, values, deviates.data());
      mark(y);
      if (means) KeepOpen(deviates.data(), noise, values, squares, limits.steady, row);
    }
    if (!means) continue;
    surroundings.Move(comes ? row_of(y) : nullptr, y >= side ? row_of(y - side) : nullptr);
    if (y >= reach && y - reach < image.rows) {
      surroundings.Judge(limits, deviates.data());
      mark(y - reach);
    }
  }
  return foreground;
}

}  // namespace silhouette
