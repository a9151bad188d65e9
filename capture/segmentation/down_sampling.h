// SPDX-License-Identifier: Apache-2.0
// From camera pixels to mask pixels.
#pragma once

#include <opencv2/core.hpp>

#include "db/mask/mask.h"

namespace silhouette {

// Lays a mask of `size` over the whole image: mask pixel (x, y) is the rectangle of the image from
// x * W / w to (x + 1) * W / w by y * H / h to (y + 1) * H / h, where a camera pixel is a unit
// square and the sizes need not divide. It is set if more than `min_cover` of its area is
// foreground; at 0 if the square of any foreground pixel overlaps it. `foreground`: 8-bit, one
// channel, not 0 where foreground. Throws std::invalid_argument if it is not, if `size` is not
// valid, or if `min_cover` is not within 0 to 1, 1 not included.
Mask DownSample(const cv::Mat& foreground, MaskSize size, double min_cover);

}  // namespace silhouette
