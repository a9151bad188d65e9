// SPDX-License-Identifier: Apache-2.0
// What settings make of images, as pictures.
#pragma once

#include <string>
#include <vector>

#include "common/picture/picture.h"
#include "tools/silhouette-capture/tune_figures.h"

namespace silhouette {

// A camera image, grey or blue, green, red.
Picture CameraPicture(const cv::Mat& image);

// One sheet: the image as the camera took it, how close the decisions about its pixels are with the
// first variant, and what each variant finds in it, with what it finds more and less than the
// first.
Picture TuneSheet(const TuneImage& image, const std::vector<TuneVariant>& variants,
                  const TunedImage& tuned);

}  // namespace silhouette
