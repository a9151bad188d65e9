// SPDX-License-Identifier: Apache-2.0
// What other programs and libraries find from the same sightings.
#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/camera/camera_model.h"
#include "calib/poses/pose_problem.h"

namespace silhouette::calibration_experiment {

// By the program mrcal-calibrate-cameras with LENSMODEL_OPENCV8: the cameras in the order of
// `views`, the world is the first one's frame. `image`: its width and height. NotFound: there is no
// such program in the PATH. Internal: it failed.
absl::StatusOr<std::vector<CameraModel>> CalibrateByMrcal(std::span<const std::string> views,
                                                          const CameraIntrinsics& image,
                                                          const Board& board,
                                                          std::span<const TagSighting> sightings);

// By each of the five methods of cv::calibrateHandEye, camera_from_base of every view from the
// problem's only board, which is on the flange. A method without a finite result is left out.
std::vector<std::vector<Eigen::Isometry3d>> CalibrateByOpenCv(const PoseProblem& problem);

}  // namespace silhouette::calibration_experiment
