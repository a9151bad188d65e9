// The tags in the images of a session of `silhouette-calibrate run`.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/boards/tag_sighting.h"
#include "calib/camera/camera_model.h"
#include "calib/detection/tag_detector.h"

namespace silhouette {

std::vector<std::string> FamiliesOf(const std::vector<Board>& boards);

// `image`: 8 bits, grey or blue, green, red.
std::vector<TagSighting> TagsIn(const cv::Mat& image, const std::string& view,
                                const std::string& frame, const std::vector<Board>& boards,
                                const Lens& lens, TagDetector& detector);

// Looks at the images again, images/VIEW/FRAME.png in the folder, now that the lenses are known, by
// view: corners are better for it. NotFound: an image is not there any more.
absl::StatusOr<std::vector<TagSighting>> DetectAgain(const std::string& folder,
                                                     const std::vector<std::string>& frames,
                                                     const std::vector<std::string>& views,
                                                     const std::vector<CameraIntrinsics>& lenses,
                                                     const std::vector<Board>& boards);

}  // namespace silhouette
