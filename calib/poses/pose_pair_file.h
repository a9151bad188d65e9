// SPDX-License-Identifier: Apache-2.0
// Pairs of poses as easy_handeye and MoveIt record them: where the robot's flange was, and where a
// board was before the camera.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace silhouette {

struct PosePair {
  Eigen::Isometry3d base_from_flange = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d camera_from_board = Eigen::Isometry3d::Identity();
};

struct PairFile {
  std::vector<PosePair> pairs;  // base_from_flange as the file has it
  // easy_handeye's, which has flange_from_base in its place where the camera stands still.
  bool easy_handeye = false;
};

// MoveIt's samples, a list of effector_wrt_world and object_wrt_sensor (4x4, row by row), or
// easy_handeye's, `samples`: a list of robot and tracking. `file`: what messages call it.
// InvalidArgument with file and line: neither of these, values that are no pose, or millimetres.
absl::StatusOr<PairFile> PosePairsFromText(const std::string& text, const std::string& file);

}  // namespace silhouette
