// SPDX-License-Identifier: Apache-2.0
// The robot's poses as a table, a line per frame:
//
//   frame,tx,ty,tz,qx,qy,qz,qw
//   0007,0.41,-0.12,0.63,0.707,0.707,0,0
//
// The columns are those of a PoseNotation, in any order. Without the first line they are in its
// order, after the frame. Fields are separated by commas, or all by semicolons, tabs or spaces
// (then with decimal commas, if that is wished); lines that begin with # are comments. A matrix may
// be on four lines. Or as JSON: {"0007": [0.41, -0.12, ...]}, numbers in the notation's order, a
// matrix as rows if that is wished; or [{"frame": "0007", "tx": 0.41, ...}]. Rows without a frame,
// JSON's [[0.41, -0.12, ...], ...], ROS poses as JSON, and lists or arrays as Python and numpy
// print them, get that of NameOfRow (pose_frames.h).
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_notation.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

std::string RobotPoseFileText(const std::vector<RobotPose>& poses);

// In the order of the file. `file`: what messages call it. InvalidArgument with file, and line or
// frame: no such table, a frame without name or there twice, and what PoseNotation refuses.
absl::StatusOr<std::vector<RobotPose>> RobotPosesFromText(const std::string& text,
                                                          const std::string& file,
                                                          const PoseNotation& notation = {});

// The same of a file for each frame, which holds nothing but the notation's numbers.
struct PoseText {
  std::string frame;
  std::string file;  // what messages call it
  std::string text;
};
absl::StatusOr<std::vector<RobotPose>> RobotPosesFromTexts(const std::vector<PoseText>& texts,
                                                           const PoseNotation& notation);

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
