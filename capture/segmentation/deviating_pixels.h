// The pixels that differ from the reference, one by one and in the mean of their surroundings.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"

namespace silhouette {

// Differences are counted in these parts of a grey level, so that all of them fit into 16 bits.
inline constexpr int kDifferenceUnit = 128;

// By which the reference's mean is multiplied, in 32768ths.
inline constexpr int kGainUnit = 32768;
uint16_t GainUnits(double gain);

// 255 where `grey` deviates, else 0. With all numbers in kDifferenceUnit-ths of a grey level, and
// `units` = GainUnits(gain):
//   the difference is 128 * grey - min(mean * units / 65536 rounded down, 128 * 255);
//   a pixel deviates if |difference| is more than noise_factor standard deviations of its noise and
//   more than min_difference;
//   or if, of the kFaintSide x kFaintSide pixels around it, more than half lie in the image and do
//   not deviate by themselves, and the mean of their differences is more than faint_difference and
//   more than noise_factor times their mean noise over the root of their number.
// `grey`: 8-bit, one channel, of the reference's size. The settings are taken to be valid.
cv::Mat DeviatingPixels(const cv::Mat& grey, const Reference& reference, double gain,
                        const SegmentationSettings& settings);

}  // namespace silhouette
