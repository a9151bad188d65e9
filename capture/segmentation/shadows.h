// SPDX-License-Identifier: Apache-2.0
// Shadows: places where the cell is evenly darker, and still looks like the cell.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/brightness.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/slow_light.h"

namespace silhouette {

// 8-bit, 255 or 0.
struct FoundShadows {
  // Shadows on the empty cell.
  cv::Mat certain;
  // What a shadow could explain: no darker than one can be, no brighter than expected.
  cv::Mat possible;
};

// Which pixels of `foreground` are shadows. A pixel is certainly one if over the foreground
// around it that is clearly darker than expected
// - the image is what is expected times one factor, the same in all channels, up to noise; and
// - that is far more probable than a surface of one colour: the cell's own texture is seen.
// Shadows on what has no texture stay foreground: a flat grey thing before a flat grey wall looks
// the same. Among such pixels - where they are 40 % of the foreground around, at least - those
// belong to the shadow that are no darker than it and no brighter than expected; what is not
// clearly darker only beside the empty cell, for a thing as bright as the cell may stand in a
// shadow. `foreground`: 8-bit, not 0 where foreground, of the image's size.
FoundShadows FindShadows(const cv::Mat& image, const Reference& reference,
                         const Brightness& brightness, const SlowLight& slow_light,
                         const cv::Mat& foreground);

}  // namespace silhouette
