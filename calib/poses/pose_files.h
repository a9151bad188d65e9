// SPDX-License-Identifier: Apache-2.0
// The robot's poses as a CSV file, a line per frame:
//
//   frame,tx,ty,tz,qx,qy,qz,qw
//   0007,0.41,-0.12,0.63,0.707,0.707,0,0
//
// base_from_flange: metres, and a quaternion with its real part last.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

std::string RobotPoseFileText(const std::vector<RobotPose>& poses);

// In the order of the file. `file`: what messages call it. InvalidArgument with file and line: not
// such a table, a frame without name or there twice, a quaternion whose length is not 1 within a
// hundredth (it is made 1), positions that can only be millimetres.
absl::StatusOr<std::vector<RobotPose>> RobotPosesFromText(const std::string& text,
                                                          const std::string& file);

// Where boards stand in the cell, by a survey, as a YAML file: a list of
//
//   - board: floor_1               # of the boards' file
//     position: [0.4, -0.2, 0.0]   # of the board's origin in the robot's base frame, metres
//     rotation: [180 deg, 0, 0]    # roll, pitch, yaw as in URDF; none if not said
//     quaternion: [1, 0, 0, 0]     # instead of rotation: x, y, z, w
//     position_sigma: 0.001        # standard deviation per axis, metres; 1 mm if not said
//     rotation_sigma: 0.5 deg      # the same of the rotation; 0.5 deg if not said

struct SurveyedBoard {
  std::string board;
  Eigen::Isometry3d base_from_board = Eigen::Isometry3d::Identity();
  double position_sigma = 1e-3;
  double rotation_sigma = 0.5 * kDegree;
};

// `file`: what messages call it. InvalidArgument with file and line: not such a list, a board
// twice, both rotations, a quaternion whose length is not 1, a sigma that is not positive, a
// position that can only be in millimetres.
absl::StatusOr<std::vector<SurveyedBoard>> SurveyFromText(const std::string& text,
                                                          const std::string& file);

}  // namespace silhouette
