// SPDX-License-Identifier: Apache-2.0
// The middles of the circles of a board in an image.
//
// OpenCV finds where they are. Each is then the centroid of what is darker than the paper around
// it, moved to where the circle's middle is seen, as perspective and lens have it near by.
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/boards/board.h"
#include "calib/detection/tag_detector.h"

namespace silhouette {

// None if not all circles are seen. `board`: of kind kCircles. `image`: CV_8UC1.
std::vector<DetectedTag> DetectCircles(const Board& board, const cv::Mat& image);

}  // namespace silhouette
