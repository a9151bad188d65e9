#include "capture/segmentation/surroundings.h"

#include <cstdlib>

#include "capture/segmentation/wider_vectors.h"

namespace silhouette {
namespace {

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
    deviates[i] = mean ? 255 : 0;
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
  for (int i = 0; i < values; ++i) {
    const auto count = static_cast<float>(NumberIn(counted[i]));
    const auto variance = static_cast<float>(variances[i]);
    const auto beyond = static_cast<float>(squares[i] - variances[i]);
    // The mean of `count` squares has the noise of one, root 2 of the variance, over the root.
    const bool texture = (count > fewest) & (beyond > least * count) &
                         (beyond * beyond * count > factor * variance * variance);
    deviates[i] = static_cast<uint8_t>(deviates[i] | (texture ? 255 : 0));
  }
}

}  // namespace

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

}  // namespace silhouette
