// What the values of an image's rows say one by one, and what they leave to their surroundings.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "capture/segmentation/brightness.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"

// The loops over the values of a row are written for the compiler to vectorise: no branches, no
// look-ups, narrow whole numbers. A row of a colour image is three values per pixel.

namespace silhouette {

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

DeviationLimits LimitsOf(const SegmentationSettings& settings, const Brightness& brightness,
                         const Reference& reference);

// What the values of a row that do not deviate by themselves, the open ones, contribute to sums
// over surroundings. Of others all is 0.
struct OpenRow {
  explicit OpenRow(size_t values)
      : difference(values), counted(values), square(values), variance(values) {}

  // Noise and number in one: so many bits have sums of the noise of any surroundings.
  static constexpr int kNoiseBits = 24;
  static_assert(int64_t{SegmentationSettings::kMostFaintSide} *
                    SegmentationSettings::kMostFaintSide * Reference::kUndefined <
                int64_t{1} << kNoiseBits);

  std::vector<int16_t> difference;  // kDifferenceUnit-ths
  std::vector<uint32_t> counted;    // the reference's noise, and 1 << kNoiseBits
  std::vector<int32_t> square;      // of differences, and of noise
  std::vector<int32_t> variance;
};

// The differences of a row to what is expected: `mean` times `gain` (GainUnits()) plus `offset`.
void FindDifferences(const uint8_t* image, const uint16_t* mean, const uint16_t* gain, int offset,
                     int values, int16_t* difference);

// What single values say: `deviates` becomes 255 or 0.
void JudgeValues(const int16_t* difference, const uint16_t* noise, const DeviationLimits& limits,
                 int values, uint8_t* deviates);

// Makes `row`, whose differences are those of FindDifferences(), what the values that do not
// deviate contribute; its squares only if `squares`.
void KeepOpen(const uint8_t* deviates, const uint16_t* noise, int values, bool squares, int steady,
              OpenRow& row);

}  // namespace silhouette
