// SPDX-License-Identifier: Apache-2.0
// How far a camera moved, measured by the silhouette of the parked robot.
#pragma once

#include <opencv2/core.hpp>

#include "calib/fundamental/tag_drift.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"
#include "db/mask/mask.h"

namespace silhouette {

// Compares the foreground of `image`, as capture and server make it, with the robot image of the
// configuration in which the robot stands: the shift, up to four mask pixels each way, and the
// turn with which the image gives that mask, or most nearly so. Good to about a tenth of a mask
// pixel. A turn counts if it changes more of the outline than noise does: one that moves the
// image's corners by less than about one mask pixel may go unnoticed. A growth is not measured. Not
// checked, and why, if the robot is hardly seen, if its outline leaves the shift or the turn open,
// or if no motion makes the two alike. Nothing else may stand near the robot. Throws
// std::invalid_argument if the image is not of the reference's size.
ViewDrift DriftBySilhouette(const std::string& view, const ViewSizes& sizes, const cv::Mat& image,
                            const Reference& reference, const SegmentationSettings& settings,
                            const Mask& robot);

}  // namespace silhouette
