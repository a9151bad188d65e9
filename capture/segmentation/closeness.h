// How close the decisions about an image's pixels are.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/brightness.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"

namespace silhouette {

// By how many times its limit each pixel differs, by itself or with what is around it, whichever
// says more: CV_32FC1, at most kFarBeyond. What DeviatingPixels() finds is above 1, all else is
// not, but for what rounding leaves open; undefined pixels are kFarBeyond. For people to look at:
// in floating-point numbers, and slow. `image`: 8-bit, of the reference's size and channels. The
// settings are taken to be valid.
inline constexpr float kFarBeyond = 100;
cv::Mat DifferenceOverLimit(const cv::Mat& image, const Reference& reference,
                            const Brightness& brightness, const SegmentationSettings& settings);

}  // namespace silhouette
