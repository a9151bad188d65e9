// SPDX-License-Identifier: Apache-2.0
// Camera poses from pairs of poses (pose_pair_file.h) instead of corners.
//
// The pairs do not say how exact they are. Their noise, of position and of rotation, is found from
// how they miss each other; an error that they share is not, but for the board's size. Pairs at one
// pose of the robot count as one, with the mean of what was seen.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_pair_file.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

struct PairResidual {
  double position = 0;  // metres
  double rotation = 0;  // radians
  bool outlier = false;
};

struct PairSolution {
  // camera_from_base; of a camera on the flange camera_from_flange.
  Eigen::Isometry3d camera_pose = Eigen::Isometry3d::Identity();
  PoseCovariance covariance = PoseCovariance::Zero();
  // flange_from_board; of a camera on the flange base_from_board.
  Eigen::Isometry3d board_pose = Eigen::Isometry3d::Identity();
  double position_sigma = 0;            // of a pair, per axis, metres
  double rotation_sigma = 0;            // radians
  std::vector<PairResidual> residuals;  // one for each pair
  size_t robot_poses = 0;               // different ones
  double size = 1;                      // factor on the distances of boards
  double size_sigma = 0;                // 0: the size was not sought
  // Ends of sentences about the view. Doubts: for these the poses are to be refused unless the user
  // accepts them: a board's size that nothing checks, halves of the session that contradict it.
  std::string warning;  // empty: none
  std::vector<std::string> doubts;
};

// FailedPrecondition, as the end of a sentence about the view: fewer than five pairs, a flange that
// turned about one axis only, a pose that a single pair decides, pairs that contradict each other,
// boards that the view's lens does not show, or boards of another size; with what would explain
// them.
absl::StatusOr<PairSolution> SolvePosePairs(std::span<const PosePair> pairs, const PoseView& view,
                                            SizeTrust trust = SizeTrust::kNeither);

// The same of a file. Robot poses that only fit inverted are taken so, with a warning.
// FailedPrecondition, too: of easy_handeye, what is on the flange is farther from it than what
// stands is from the base, as if the camera were at the other end of the robot.
absl::StatusOr<PairSolution> SolvePairFile(const PairFile& file, const PoseView& view,
                                           SizeTrust trust = SizeTrust::kNeither);

}  // namespace silhouette
