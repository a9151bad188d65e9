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
#include "capture/sim/tag_projection.h"

namespace silhouette::calibration_experiment {

// By the program mrcal-calibrate-cameras with LENSMODEL_OPENCV8, in the order of the true cameras
// and in a frame of its own. It begins with a true focal length; with boards that are seen in part
// it often ends hundreds of pixels off. NotFound: there is no such program in the PATH. Internal:
// it failed.
absl::StatusOr<std::vector<CameraModel>> CalibrateByMrcal(std::span<const NamedCamera> truth,
                                                          const Board& board,
                                                          std::span<const TagSighting> sightings);

// By each of the five methods of cv::calibrateHandEye, camera_from_base of every view from the
// problem's only board, which is on the flange. A method without a finite result is left out.
std::vector<std::vector<Eigen::Isometry3d>> CalibrateByOpenCv(const PoseProblem& problem);

}  // namespace silhouette::calibration_experiment
