// SPDX-License-Identifier: Apache-2.0
// What other programs and libraries find from the same sightings.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
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

// The corners that OpenCV finds of the board in an image (CV_8UC1), pixels, in no order: those of
// findChessboardCornersSB, interpolateCornersCharuco, findCirclesGrid or, of tags, detectMarkers
// with CORNER_REFINE_SUBPIX. Nothing: it cannot read the board's tags.
std::optional<std::vector<Eigen::Vector2d>> CornersByOpenCv(const Board& board,
                                                            const cv::Mat& image);

// Corners of a board, and where they are seen in one image.
struct SeenCorners {
  std::vector<Eigen::Vector3d> on_board;
  std::vector<Eigen::Vector2d> pixels;
};

// By cv::calibrateCamera with its rational model, which is LENSMODEL_OPENCV8, from images that show
// at least eight corners. Internal: it failed.
absl::StatusOr<CameraModel> LensByOpenCv(int width, int height,
                                         std::span<const SeenCorners> images);

// By each of the five methods of cv::calibrateHandEye, camera_from_base of every view from the
// problem's only board, which is on the flange. A method without a finite result is left out.
std::vector<std::vector<Eigen::Isometry3d>> CalibrateByOpenCv(const PoseProblem& problem);

}  // namespace silhouette::calibration_experiment
