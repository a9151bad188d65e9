// SPDX-License-Identifier: Apache-2.0
// How much brighter the whole image is than the reference.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/reference.h"
#include "capture/segmentation/slow_light.h"

namespace silhouette {

// What the reference's grey levels have become: multiplied by `gain`, then `offset` grey levels
// more.
struct Brightness {
  double gain = 1;
  double offset = 0;
};

// That which explains as many pixels of `image` as possible within their noise; robot and
// obstacles, which it does not explain, have no part in it. The offset - stray light, a camera's
// black level - is 0 unless it explains clearly more than a gain alone. Gain 1 and offset 0 if too
// few pixels are bright enough to tell, or if the image is not even half or more than twice as
// bright: that is no drift of the light. `slow_light` is taken out before. `image`: 8-bit, of the
// reference's size and channels.
Brightness BrightnessOf(const cv::Mat& image, const Reference& reference,
                        const SlowLight& slow_light = {});

}  // namespace silhouette
