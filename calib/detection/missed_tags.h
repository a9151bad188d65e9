// SPDX-License-Identifier: Apache-2.0
// The tags of a board that the libraries miss: the squares that Kalibr prints between tags touch
// their corners, so that the AprilTag library sees no quadrilaterals, and OpenCV overlooks every
// tenth ArUco marker. Where they are follows from the tags near them.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "calib/boards/board.h"
#include "calib/camera/camera_model.h"
#include "calib/detection/tag_detector.h"

namespace silhouette {

// The board's tags that are not among `found`, at least two of which are its own. Each has the
// modules of its id and all four edges. `board`: of tags; `image`: CV_8UC1.
std::vector<DetectedTag> MissedTags(const Board& board, const cv::Mat& image,
                                    const std::optional<CameraModel>& lens,
                                    std::span<const DetectedTag> found);

}  // namespace silhouette
