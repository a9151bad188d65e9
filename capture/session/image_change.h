// SPDX-License-Identifier: Apache-2.0
// What changed from one camera image of a view to another.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"

namespace silhouette {

// 255 in the connected areas of at least `least_pixels` pixels that differ between two images of
// one view: by more than min_difference grey levels and by more than noise_factor standard
// deviations of the difference of two images, a change of the whole image's brightness taken out.
// `reference`: that of the view, for its noise; null, while there is none: then the noise is what
// most pixels of the two images differ by. Throws std::invalid_argument if the sizes differ.
cv::Mat ChangedAreas(const cv::Mat& before, const cv::Mat& after, const Reference* reference,
                     const SegmentationSettings& settings, int least_pixels);

// Whether two images are the same, byte for byte.
bool SameImage(const cv::Mat& before, const cv::Mat& after);

// Whether there are any of min_blob_pixels pixels: the robot did not stand still, say.
bool ImagesDiffer(const cv::Mat& before, const cv::Mat& after, const Reference* reference,
                  const SegmentationSettings& settings);

}  // namespace silhouette
