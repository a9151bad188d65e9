// Pictures of what `detect` has found.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "calib/detection/image_tags.h"
#include "common/picture/picture.h"

namespace silhouette {

// The image with the tags' outlines, ids and corners; `image` as it was looked at.
Picture PictureOfTags(const cv::Mat& image, const ImageTags& tags);

// All corners that a view has seen, over the cells of its coverage.
Picture PictureOfCoverage(const std::string& view, const Coverage& coverage);

}  // namespace silhouette
