// Whether the robot stood still from one set of images to the next.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"

namespace silhouette {

// Whether an area of `settings.min_blob_pixels` pixels or more differs between two images of one
// view: by more than min_difference grey levels and by more than noise_factor standard deviations
// of the difference of two images, a change of the whole image's brightness taken out. `reference`:
// that of the view, for its noise. Throws std::invalid_argument if the sizes differ.
bool ImagesDiffer(const cv::Mat& before, const cv::Mat& after, const Reference& reference,
                  const SegmentationSettings& settings);

}  // namespace silhouette
