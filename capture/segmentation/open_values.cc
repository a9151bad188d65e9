#include "capture/segmentation/open_values.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "capture/segmentation/deviating_pixels.h"
#include "capture/segmentation/wider_vectors.h"

namespace silhouette {
namespace {

constexpr int kOpenValuesBrightest = 255 * kDifferenceUnit;  // a camera shows nothing brighter
// From the reference's units to kDifferenceUnit-ths.
constexpr float kNoiseUnit = static_cast<float>(kDifferenceUnit) / Reference::kGreyLevel;
// Squares are those of 16ths of a grey level, of 64 grey levels at the most.
constexpr float kSquareUnit = 16;
constexpr int16_t kOpenValuesMostSquared = 1023;
constexpr int kOpenValuesUnsteady = 3;  // times the typical noise

}  // namespace

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
    deviates[i] = (size > allowed) | (own == Reference::kUndefined) ? 255 : 0;
  }
}

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

}  // namespace silhouette
