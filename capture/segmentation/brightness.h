// How much brighter the whole image is than the reference.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/reference.h"

namespace silhouette {

// The factor by which the reference's grey levels are multiplied to explain as many pixels of
// `grey` as possible within their noise; robot and obstacles, which no factor explains, have no
// part in it. 1 if too few pixels are bright enough to tell, or if the image is not even half or
// more than twice as bright: that is no drift of the light. `grey`: 8-bit grey, of the reference's
// size.
double BrightnessGain(const cv::Mat& grey, const Reference& reference);

}  // namespace silhouette
