// Connected areas of an image of two values.
#pragma once

#include <opencv2/core.hpp>

namespace silhouette {

// Sets to 0 all areas of `foreground` that have fewer than `min_pixels`. An area is what is not 0
// and connected over edges and corners. `foreground`: 8-bit, one channel.
void DropSmallAreas(cv::Mat& foreground, int min_pixels);

}  // namespace silhouette
