// SPDX-License-Identifier: Apache-2.0
// The pixels that differ from the reference, one by one and in the mean of their surroundings.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "capture/segmentation/brightness.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"
#include "capture/segmentation/slow_light.h"

namespace silhouette {

// What an image's foreground rests on. Strong evidence is that of a single pixel, or that of its
// surroundings with kStrongFactor times the limits of the settings. Grey levels of an 8-bit image,
// so that cleaning it up treats the strong foreground in it exactly as if it were alone: opening
// and closing commute with thresholds.
inline constexpr uint8_t kShadow = 1;        // only in a GradedForeground (difference.h)
inline constexpr uint8_t kThinEvidence = 2;  // likewise
inline constexpr uint8_t kWeakEvidence = 3;
inline constexpr uint8_t kStrongEvidence = 255;
// With the default settings a texture_difference of 3: noise alone does not reach it at the robot's
// rim, and obstacles are still found on 99.6 % of the mask pixels (docs/segmentation.md).
inline constexpr float kStrongFactor = 4.0F / 3;

// kWeakEvidence or kStrongEvidence where `image` deviates, else 0. With all numbers in 128ths of a
// grey level:
//   the difference is 128 * level - expected, where expected is mean * units / 65536, rounded down,
//   and the offset, within 0 and 128 * 255, `units` being the gain times the slow light's factor in
//   32768ths; if the reference's pixel is saturated, it is 0 at the most: the pixel's
//   real brightness is not known; a pixel deviates if |difference| is more than noise_factor
//   standard deviations of its noise and more than min_difference, in any channel, or if it is
//   undefined; or if, of the faint_side x faint_side pixels around it, more than half lie in the
//   image and do not deviate by themselves, and in some channel
//   - the mean of their differences is more than faint_difference and more than noise_factor times
//     their mean noise over the root of their number, or
//   - the mean of their squared differences, beyond the mean of their squared noise, is more than
//     texture_difference squared and more than noise_factor times its own standard deviation for
//     normally distributed noise; what has more than three times the typical noise of the
//     reference, and more than a grey level, counts as 0 in both.
// `image`: 8-bit, of the reference's size and channels. The settings are taken to be valid.
cv::Mat DeviatingPixels(const cv::Mat& image, const Reference& reference,
                        const Brightness& brightness, const SlowLight& slow_light,
                        const SegmentationSettings& settings);

}  // namespace silhouette
